"""Projects of AICON 3D Studio."""

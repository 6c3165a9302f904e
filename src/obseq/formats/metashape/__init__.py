"""Projects of Metashape."""

"""Projects of Comp3D."""

"""What goes wrong in surveys: one cause is one object in one file, and one line in the registry."""

"""Scripts of DBAT."""

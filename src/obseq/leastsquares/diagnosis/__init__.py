"""What is wrong with a system that cannot be solved, in the names of its unknowns."""

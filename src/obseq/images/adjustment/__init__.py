"""A block as a least-squares system, and what the solution says of it."""

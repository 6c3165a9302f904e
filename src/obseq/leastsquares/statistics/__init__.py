"""What the solution says of its observations: reliability, tests, components, ellipses."""

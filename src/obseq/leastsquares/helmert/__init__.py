"""Networks larger than a machine: adjusted in Helmert blocks, a tree of eliminations for any executor."""

"""Networks of GNU Gama."""

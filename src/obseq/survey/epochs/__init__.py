"""Two epochs of a network: what has moved, with the tests that say so."""

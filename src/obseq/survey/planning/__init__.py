"""A network before it is measured: simulated observations, precisions to expect, what more would bring."""

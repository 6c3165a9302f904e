"""The compiled loops of assembly, elimination and leverages: numba, and nothing else of this package."""

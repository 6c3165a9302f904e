"""The least squares of a network: its frame, its equations, its adjusted points."""

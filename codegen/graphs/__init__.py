"""Graphs of expressions: made of equations, differentiated, and made shorter."""

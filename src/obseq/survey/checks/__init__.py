"""What the observations of a network are asked before it is adjusted, wherever they come from."""

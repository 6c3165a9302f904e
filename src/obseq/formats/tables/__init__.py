"""Tables of points and observations: files (.csv), and columns in memory."""

"""Initial values: positions of points and orientations of stations from the observations alone."""

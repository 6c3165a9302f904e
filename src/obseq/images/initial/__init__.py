"""First values of a block, from nothing but measures: poses, points, calibrations."""

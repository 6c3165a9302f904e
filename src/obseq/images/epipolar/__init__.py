"""Epipolar residuals: whether two orientations agree, from points that both images see."""

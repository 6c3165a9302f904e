"""Commands on images: blocks, satellites, targets, aerial geometry, epipolar residuals."""

"""Epipolar residuals: whether two orientations agree, from points that both images see."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

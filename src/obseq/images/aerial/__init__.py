"""Aerial images on a map: from image to ground and back, intersection, resection, RPC, Borea's files.

Image axes: columns to the right, lines downwards, pixels. Map coordinates and z in metres.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""One adjustment of points, stations, images and instruments, which takes any formula by named parts."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

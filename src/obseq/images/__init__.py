"""Images: cameras, poses, measures, control points, first values of a block, bundle adjustment.

Every public name is here; each is loaded when it is first used. Pixels for image coordinates; any one length
unit for the world; radians.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

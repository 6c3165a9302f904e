"""Survey networks: points, observations, stations and initial values.

Names are loaded when they are first used: who adjusts a network does not load what plans one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

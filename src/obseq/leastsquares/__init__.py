"""Least squares: unknowns by name, equations in batches, sparse normal equations, precisions.

Every public name is here; each is loaded when it is first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

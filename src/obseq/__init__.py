"""Observation equations: written once, generated as kernels, adjusted by least squares.

Names are loaded when they are first used: `import obseq` itself imports next to nothing.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Files of surveys and of image blocks: one folder a program, all read into the same objects.

Names are loaded when they are first used: who reads a file does not load what reads others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

"""Project trees of MMVII (`MMVII-PhgrProj`) and MicMac's files, as objects of `obseq.images` and back."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

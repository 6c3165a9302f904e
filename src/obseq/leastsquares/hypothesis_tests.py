"""Former place of the global test: `from obseq.leastsquares import ...`."""

from obseq.leastsquares.former import moved

__getattr__ = moved(__name__)

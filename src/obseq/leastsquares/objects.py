"""Former place of unknowns as objects: `from obseq.leastsquares import ...`."""

from obseq.leastsquares.former import moved

__getattr__ = moved(__name__)

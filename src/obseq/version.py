"""The version of obseq, as it was installed."""

from obseq.packages import version

__version__ = version("obseq")

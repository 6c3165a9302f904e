"""Former place of reliability of observations: `from obseq.leastsquares import ...`.

Importing this file binds its module where `obseq.leastsquares` has the function of the same name, so it can
be called as that function.
"""

import sys
from types import ModuleType
from typing import Any

from obseq.leastsquares.former import moved
from obseq.leastsquares.statistics import reliability as _now

__getattr__ = moved(__name__)


class _Called(ModuleType):
    """A module that stands for a function."""

    def __call__(self, *args: Any, **kwargs: Any) -> _now.Reliability:
        return _now.reliability(*args, **kwargs)


sys.modules[__name__].__class__ = _Called

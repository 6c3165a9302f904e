"""`cached_property` without a lock, as Python itself has it from 3.12 on.

That of Python 3.11 holds a lock, one for all objects of a class, while it computes a value. A process that is
forked meanwhile has the lock and nobody who lets go of it: the first to ask there waits for ever.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable
    from functools import cached_property as cached_property
else:

    class CachedProperty:
        """A property that is computed once for each object; two threads at a time both compute it."""

        def __init__(self, compute: Callable[[Any], Any]) -> None:
            self.compute = compute
            self.__doc__ = compute.__doc__

        def __set_name__(self, owner: type, name: str) -> None:
            self.name = name

        def __get__(self, instance: Any, owner: type | None = None) -> Any:
            """The value kept in the object, which from then on stands before this property."""
            if instance is None:
                return self
            return instance.__dict__.setdefault(self.name, self.compute(instance))

    cached_property = CachedProperty

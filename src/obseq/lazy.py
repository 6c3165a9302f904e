"""Names that are loaded when they are first used, so that importing a package imports next to nothing."""

import importlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any


def lazy_names(
    package: str,
    homes: Mapping[str, Sequence[str]],
    public: Sequence[str],
    former: Mapping[str, str] | None = None,
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """The `__getattr__` and the `__dir__` of a package.

    Args:
        package: its name.
        homes: the names that each module has, modules relative to the package; a module without names is
            itself the name.
        public: all public names.
        former: names that public ones had before; they work, and warn.
    """
    modules = {name: module for module, names in homes.items() for name in names or (module,)}

    def find(name: str) -> Any:
        now = (former or {}).get(name)
        if now is not None:
            message = f"{package}.{name} is called {now}: from {package} import {now}"
            warnings.warn(message, DeprecationWarning, stacklevel=2)
            return find(now)
        if name not in modules:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = importlib.import_module(f".{modules[name]}", package)
        return getattr(module, name) if homes[modules[name]] else module

    return find, lambda: sorted(public)

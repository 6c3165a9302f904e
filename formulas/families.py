"""Any member of a family by its name, generated or not, registered or not."""

from obseq.errors import FormulaError, nearest
from obseq.formulas import REGISTRY
from obseq.formulas.base import Formula

FAMILIES: tuple[type[Formula], ...] = tuple(
    dict.fromkeys(type(registered) for registered in REGISTRY if "{" in registered.pattern)
)
"""The classes of the registry whose names have fields."""


def find(name: str) -> Formula | None:
    """The formula of the registry, else the member of a family, of a name; None when there is none.

    Raises:
        FormulaError: A number in the name is too large or too small for its family.
    """
    for registered in REGISTRY:
        if registered.name == name:
            return registered
    members = (member for family in FAMILIES if (member := family.from_name(name)) is not None)
    return next(members, None)


def formula(name: str) -> Formula:
    """The formula of a name: of the registry, else the member of a family.

    Raises:
        FormulaError: No formula has that name; the message gives the nearest ones.
    """
    if (found := find(name)) is not None:
        return found
    near = nearest(name, [registered.name for registered in REGISTRY])
    raise FormulaError(f"no formula is named {near} (gencode --list gives all)")

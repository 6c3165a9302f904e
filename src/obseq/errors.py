"""The errors that obseq raises: one base class and a handful of causes."""

import difflib
from collections.abc import Iterable

LONGEST_NAME = 200
"""Characters of the longest name that is looked for; longer ones are refused unread."""


class ObseqError(Exception):
    """Base of every error that obseq raises on purpose; its message is meant for the user."""


class InputError(ObseqError):
    """A file, a point, an observation or a parameter is wrong; the message says which and what to do."""


class FormulaError(ObseqError):
    """A formula is unknown, or its definition or its arguments are not what they must be."""


class SingularSystemError(ObseqError):
    """The observations do not determine some unknowns; `unknowns` names them."""

    def __init__(self, message: str, unknowns: tuple[str, ...] = ()) -> None:
        super().__init__(message)
        self.unknowns = unknowns


class CrsError(InputError):
    """A coordinate system is unknown or incomplete, or cannot do what is asked of it."""


def nearest(name: str, known: Iterable[str]) -> str:
    """A name that means nothing, and the known ones most like it: the middle of a sentence about it."""
    if len(name) > LONGEST_NAME:
        return f"{name[:40]!r}... ({len(name)} characters; names have at most {LONGEST_NAME})"
    near = ", ".join(difflib.get_close_matches(name, list(known), n=4, cutoff=0.5)) or "none"
    return f"{name!r}; nearest names: {near}"

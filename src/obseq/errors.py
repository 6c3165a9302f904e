"""The errors that obseq raises: one base class and a handful of causes."""


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

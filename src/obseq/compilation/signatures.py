"""Signatures of compiled functions, read from their annotations: what reaches machine code, and how.

The names of `obseq.arrays` say type and number of dimensions; arrays are C-contiguous. A NamedTuple of
arrays is handed over member by member.
"""

from __future__ import annotations

from types import FunctionType
from typing import Any

from obseq.dataclass import dataclass

ARRAYS = {
    "FloatArray": ("float64", 1),
    "FloatRows": ("float64", 2),
    "FloatCubes": ("float64", 3),
    "IntArray": ("int64", 1),
    "IntRows": ("int64", 2),
    "PositionArray": ("uint32", 1),
    "PositionRows": ("uint32", 2),
    "IndexArray": ("int32", 1),
    "IndexRows": ("int32", 2),
    "KeyArray": ("uint64", 1),
    "ByteArray": ("uint8", 1),
    "ByteRows": ("uint8", 2),
    "BoolArray": ("bool", 1),
}
"""Type of the entries and number of dimensions of the arrays that annotations name."""

SCALARS = {"int": "int64", "float": "float64", "bool": "bool"}
RESULTS = {"int": "int64", "float": "float64", "None": None}


@dataclass(frozen=True)
class Parameter:
    """One argument as machine code gets it.

    Attributes:
        name: name of the parameter; of a member of a NamedTuple, with the name after a dot.
        type: type of the number, or of the entries of an array.
        dimensions: number of dimensions of an array; 0 for a number, -1 for a pointer to tiles.
    """

    name: str
    type: str
    dimensions: int

    def __str__(self) -> str:
        return f"{self.name}: {self.type}" + ("[" + ", ".join(":" * self.dimensions) + "]") * (
            self.dimensions > 0
        )


@dataclass(frozen=True)
class Argument:
    """One parameter of the Python function.

    Attributes:
        name: its name.
        parameters: what machine code gets of it.
        record: the NamedTuple that it is, or None.
    """

    name: str
    parameters: tuple[Parameter, ...]
    record: type[tuple[Any, ...]] | None = None


@dataclass(frozen=True)
class Signature:
    """Arguments and result of a compiled function.

    Attributes:
        arguments: the arguments of the Python function.
        result: type of the result: a number, or None.
        at_once: whether Python calls it as one of its builtins (see `loops.QuickLoop`).
        wide: whether it gains by the widest vectors of a processor, which compilers avoid in short loops.
    """

    arguments: tuple[Argument, ...]
    result: str | None
    at_once: bool = False
    wide: bool = False

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What machine code gets, in order."""
        return tuple(parameter for argument in self.arguments for parameter in argument.parameters)

    def __str__(self) -> str:
        together = f"({', '.join(map(str, self.parameters))}) -> {self.result}"
        return together + " at once" * self.at_once + " wide" * self.wide


KERNEL = Signature(
    (
        Argument("tiles", (Parameter("tiles", "float64", -1),)),
        Argument("n_tiles", (Parameter("n_tiles", "int64", 0),)),
    ),
    None,
    wide=True,
)
"""Signature of generated kernels: aligned tiles and their number."""


def signature_of(function: FunctionType, at_once: bool = False) -> Signature:
    """The signature that the annotations of a function say.

    Raises:
        TypeError: an annotation is missing or not one of those that machine code knows.
    """
    code = function.__code__
    names = code.co_varnames[: code.co_argcount]
    arguments = tuple(_argument(function, name) for name in names)
    result = _text(function.__annotations__.get("return"))
    if result not in RESULTS:
        raise TypeError(f"{function.__name__}: a loop returns int, float or None, not {result}")
    return Signature(arguments, RESULTS[result], at_once)


def _argument(function: FunctionType, name: str) -> Argument:
    annotation = function.__annotations__.get(name)
    text = _text(annotation)
    if text in ARRAYS or text in SCALARS:
        return Argument(name, (_parameter(name, text),))
    record = function.__globals__.get(text) if isinstance(annotation, str) else annotation
    if not (isinstance(record, type) and issubclass(record, tuple) and hasattr(record, "_fields")):
        raise TypeError(f"{function.__name__}: {name}: {text} is not what a loop can be given")
    members = tuple(
        _parameter(f"{name}.{field}", _text(record.__annotations__[field])) for field in record._fields
    )
    return Argument(name, members, record)


def _parameter(name: str, text: str) -> Parameter:
    if text in SCALARS:
        return Parameter(name, SCALARS[text], 0)
    return Parameter(name, *ARRAYS[text])


def _text(annotation: object) -> str:
    if isinstance(annotation, str):
        return annotation
    name = getattr(annotation, "__forward_arg__", None)  # NamedTuple keeps them so
    return str(name or getattr(annotation, "__name__", annotation))

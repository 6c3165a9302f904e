"""Names with fields: one pattern gives the name of a member of a family, and the member of a name.

A family is a frozen dataclass with a `pattern` such as `"SumSquare_{number}"`. How a field stands in a name
follows from its type: a whole number as it is, a part that has a pattern of its own by its name; anything
else by what it is annotated with (`Annotated[bool, Flag("_WCste")]`).
"""

import dataclasses
import functools
import re
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

from obseq.errors import FormulaError

LARGEST = 200
"""Largest whole number in a name: degrees, numbers of points or of coefficients."""

DIGITS = r"(?:0|[1-9]\d{0,17})"
FIELD = re.compile(r"\{(\w+)\}")


class Spelling(Protocol):
    """How a field stands in a name."""

    def expression(self) -> str:
        """Regular expression of its texts, without groups that capture."""

    def read(self, text: str) -> object:
        """The value that a text means."""

    def write(self, value: Any) -> str:
        """The text of a value."""

    def complaint(self, value: Any) -> str:
        """What is required of a value that is not allowed, empty when it is."""


@dataclass(frozen=True)
class Whole:
    """A whole number up to `LARGEST`; None, where that is allowed, for a text that is not there.

    Attributes:
        least: The least number.
        before: Text before the number, absent with it; empty when there is always a number.
    """

    least: int = 0
    before: str = ""

    def expression(self) -> str:
        """The expression of its texts."""
        return f"(?:{self.before}{DIGITS})?" if self.before else DIGITS

    def read(self, text: str) -> int | None:
        """The number."""
        return int(text.removeprefix(self.before)) if text else None

    def write(self, value: int | None) -> str:
        """The digits, after the text before them."""
        return "" if value is None else f"{self.before}{value}"

    def complaint(self, value: object) -> str:
        """The range, for anything outside."""
        if (self.before and value is None) or (isinstance(value, int) and self.least <= value <= LARGEST):
            return ""
        return f"at least {self.least} and at most {LARGEST}"


@dataclass(frozen=True)
class Flag:
    """A text that stands in the name when the field is true, or when it is false.

    Attributes:
        text: The text.
        when: The value that it stands for.
    """

    text: str
    when: bool = True

    def expression(self) -> str:
        """The expression of its texts."""
        return f"(?:{self.text})?"

    def read(self, text: str) -> bool:
        """Whether the text is there, or whether it is not."""
        return bool(text) is self.when

    def write(self, value: bool) -> str:
        """The text, or none."""
        return self.text if value is self.when else ""

    def complaint(self, value: object) -> str:
        """Something, for anything but True and False."""
        return "" if isinstance(value, bool) else "True or False"


@dataclass(frozen=True)
class OneOf:
    """One of some values, each with its name.

    Attributes:
        values: The values by name.
    """

    values: Mapping[str, object]

    def expression(self) -> str:
        """The expression of its texts."""
        return f"(?:{'|'.join(self.values)})"

    def read(self, text: str) -> object:
        """The value of that name."""
        return self.values[text]

    def write(self, value: object) -> str:
        """The name of a value."""
        return next(name for name, known in self.values.items() if known == value)

    def complaint(self, value: object) -> str:
        """The names, for anything else."""
        return "" if value in self.values.values() else f"one of {', '.join(self.values)}"


@dataclass(frozen=True)
class Part:
    """A part of a name that has a pattern of its own.

    Attributes:
        kind: Its class.
    """

    kind: "type[Patterned]"

    def expression(self) -> str:
        """The expression of its texts."""
        return self.kind.expression()

    def read(self, text: str) -> "Patterned | None":
        """The part of that name."""
        return self.kind.from_name(text)

    def write(self, value: "Patterned") -> str:
        """Its name."""
        return value.name

    def complaint(self, value: object) -> str:
        """The class, for anything else."""
        return "" if isinstance(value, self.kind) else f"a {self.kind.__name__}"


@dataclass(frozen=True)
class Registered:
    """A formula in the name of one that is made of it, by its own name.

    Attributes:
        members: Those that are found by their names; others may be given, too.
    """

    members: "tuple[Patterned, ...]"

    def expression(self) -> str:
        """The names."""
        return f"(?:{'|'.join(member.name for member in self.members)})"

    def read(self, text: str) -> "Patterned":
        """The formula of that name."""
        return next(member for member in self.members if member.name == text)

    def write(self, value: "Patterned") -> str:
        """Its name."""
        return value.name

    def complaint(self, value: object) -> str:
        """A formula, for anything else."""
        return "" if isinstance(value, Patterned) else "a formula"


class Patterned:
    """What has a name with fields: the families of formulas, and parts of their names.

    Attributes:
        pattern: The name, with each field in braces; empty for a name that is the class's.
    """

    pattern: ClassVar[str] = ""

    def __post_init__(self) -> None:
        """Raises FormulaError when a field that stands in the name has a value that is not allowed."""
        for field, spelling in self.spellings().items():
            if required := spelling.complaint(value := getattr(self, field)):
                raise FormulaError(f"{type(self).__name__}: {field} must be {required}, not {value!r}")

    @property
    def name(self) -> str:
        """The registered name, MMVII's."""
        texts = {field: way.write(getattr(self, field)) for field, way in self.spellings().items()}
        return self.pattern.format(**texts) or type(self).__name__

    @classmethod
    def from_name(cls, name: str) -> Self | None:
        """The member that has a name; None when it is not one of this family.

        Raises:
            FormulaError: A number in the name is too large or too small.
        """
        match = re.fullmatch(cls.expression(named=True), name)
        if match is None:
            return None
        return cls(**{field: way.read(match[field]) for field, way in cls.spellings().items()})

    @classmethod
    def expression(cls, named: bool = False) -> str:
        """The regular expression of the names, each field a group of its name when `named`."""
        ways = cls.spellings()

        def group(field: re.Match[str]) -> str:
            return f"({f'?P<{field[1]}>' if named else '?:'}{ways[field[1]].expression()})"

        return FIELD.sub(group, cls.pattern or cls.__name__)

    @classmethod
    @functools.cache
    def spellings(cls) -> Mapping[str, Spelling]:
        """How each field of the pattern stands in the name."""
        wanted = FIELD.findall(cls.pattern)
        hints = typing.get_type_hints(cls, include_extras=True) if wanted else {}
        fields = {field.name for field in dataclasses.fields(cls)} if wanted else set()  # type: ignore[arg-type]
        if missing := [name for name in wanted if name not in fields]:
            raise FormulaError(f"{cls.__name__}: the pattern names no field {', '.join(missing)}")
        return {name: _spelling(cls, name, hints[name]) for name in wanted}


def _spelling(cls: type, field: str, hint: object) -> Spelling:
    """How a field of that annotation stands in a name."""
    if typing.get_origin(hint) is typing.Annotated:
        found: Spelling = typing.get_args(hint)[1]
        return found
    if hint is int:
        return Whole()
    if isinstance(hint, type) and issubclass(hint, Patterned):
        return Part(hint)
    raise FormulaError(f"{cls.__name__}: annotate {field} with how it is spelt (Whole, Flag, OneOf)")

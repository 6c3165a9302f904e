"""MMVII's own commands: their arguments and options, and what they are here.

One table, from which `obseq mmvii`, its help and the page "Coming from MMVII" follow. A command of the
original takes mandatory arguments by place and options as ``Name=Value``. Here they become words of a command
of ours.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.project.options.option_values import Value, parse_value

Words = Callable[[str, Value], list[str]]
"""The words of our command for an option of the original, from its name and its value."""


@dataclass(frozen=True)
class Option:
    """An option of the original.

    Attributes:
        name: as it is typed.
        about: what it does, in a few words.
        words: what it becomes here.
    """

    name: str
    about: str
    words: Words


@dataclass(frozen=True)
class Form:
    """One way of giving the mandatory arguments.

    Attributes:
        places: their names.
        words: our words from their values, in our order.
    """

    places: tuple[str, ...]
    words: Callable[[Sequence[str]], list[str]]


@dataclass(frozen=True)
class Spelling:
    """A command of the original.

    Attributes:
        name: as it is typed.
        ours: the command here; empty where there is none yet.
        about: what it does.
        forms: ways of giving its mandatory arguments; they differ in number.
        options: those that it takes.
        example: a line of the training.
        differs: what is done otherwise here, and why.
    """

    name: str
    ours: str
    about: str
    forms: tuple[Form, ...] = ()
    options: tuple[Option, ...] = ()
    example: str = ""
    differs: str = ""


def in_our_words(spelling: Spelling, given: Sequence[str]) -> tuple[list[str], list[str]]:
    """The words of our command, and the options that have no effect here.

    Raises:
        InputError: arguments are missing or too many, or an option is not known.
    """
    known = {option.name: option for option in spelling.options}
    places: list[str] = []
    words: list[str] = []
    idle: list[str] = []
    for word in given:
        name, equals, text = word.partition("=")
        if not equals or not name.isidentifier():
            places.append(word)
            continue
        if name in IDLE and name not in known:
            idle.append(name)
            continue
        if name not in known:
            near = difflib.get_close_matches(name, [*known, *IDLE], n=1)
            meant = f"; did you mean {near[0]}?" if near else ""
            raise InputError(
                f"{spelling.name} has no option {name}{meant} ({' '.join(known) or 'it has none'})"
            )
        words += known[name].words(name, parse_value(_unquoted(text), name))
    form = next((form for form in spelling.forms if len(form.places) == len(places)), None)
    if form is None:
        raise InputError(_wrong_number(spelling, places))
    return [*form.words([_unquoted(place) for place in places]), *words], idle


def usage(spelling: Spelling) -> str:
    """How the command is typed."""
    lines = [f"{spelling.name} {' '.join(form.places)}" for form in spelling.forms]
    options = " ".join(f"{option.name}=" for option in spelling.options)
    return "\n".join(f"{line} [{options}]" if options else line for line in lines)


def _wrong_number(spelling: Spelling, places: Sequence[str]) -> str:
    """What is missing, or too much."""
    most = max(spelling.forms, key=lambda form: len(form.places)).places
    least = min(spelling.forms, key=lambda form: len(form.places)).places
    if len(places) < len(least):
        missing = " ".join(least[len(places) :])
        return f"{spelling.name}: {missing} is missing. It is typed\n{usage(spelling)}"
    extra = " ".join(places[len(most) :]) or " ".join(places)
    return f"{spelling.name}: {extra} is too much. It is typed\n{usage(spelling)}"


def _unquoted(text: str) -> str:
    """A text without quotes around it, and around the items of a list."""
    return text.replace('"', "").replace("'", "")


def value(to: str) -> Words:
    """An option of ours that takes one value."""

    def words(name: str, given: Value) -> list[str]:
        if isinstance(given, list):
            raise InputError(f"{name} takes one value, not a list")
        return [f"{to}={given}"]

    return words


def values(to: str) -> Words:
    """An option of ours that takes several values."""

    def words(name: str, given: Value) -> list[str]:
        items = given if isinstance(given, list) else [given]
        if any(isinstance(item, list) for item in items):
            raise InputError(f"{name} takes a list of values, not of lists")
        return [to, *map(str, items)]

    return words


def switch(to: str) -> Words:
    """An option of ours that is there or not."""

    def words(name: str, given: Value) -> list[str]:
        if given not in ("0", "1", "true", "false"):
            raise InputError(f"{name} is 0 or 1")
        return [to] if given in ("1", "true") else []

    return words


def as_typed(name: str, given: Value) -> list[str]:
    """An option that our command takes as the original has it."""
    return [f"{name}={_typed(given)}"]


def _typed(given: Value) -> str:
    return given if isinstance(given, str) else f"[{','.join(map(_typed, given))}]"


def in_order(*order: int) -> Callable[[Sequence[str]], list[str]]:
    """Our positional arguments: those of the original at these places."""
    return lambda given: [given[k] for k in order]


IDLE = {
    "NbStep0": "nothing is looked for on a grid",
    "NbStep": "nothing is looked for on a grid",
    "DMGon": "angles are told in radians",
    "DataDir": "folders are named where they are used",
    "LVM": "steps are damped by themselves where that is needed",
    "Debug": "nothing is drawn or printed on the way",
    "ShowByBloc": "each pair of cameras is always shown",
    "ShowAll": "everything is always shown",
    "Show": "everything is always shown",
    "NbProc": "threads are chosen from the size",
    "UC_UK": "precisions of all unknowns are in the report",
    "DirProj": "run the command in the folder of the project",
}
"""Options of the original that do nothing here, and why."""

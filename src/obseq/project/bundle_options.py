"""The options of MMVII's `OriBundleAdj`, as it writes them: `GCP3D=[[Terrain,1]] BRW=[1e-2,1e-5]`.

Both spellings are understood: that of 2026, and that of 2024 (`GCPDir`, `GCPW`, `AddGCPW`, `GCPDirOut`). What
is not understood, or would have no effect, is refused.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from obseq.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

Value: TypeAlias = "str | list[Value]"

KNOWN = (
    "NbIter", "GCP3D", "GCP2D", "GCPDir", "GCPW", "AddGCPW", "GCPDirOut", "PPFzCal", "PPFreeCal", "SharedIP",
    "PatFzCenters", "PatFzOrient", "PoseVisc", "RefOri", "BRDirIn", "BRW", "BRW_Rat", "OutRigBlock",
    "TopoDirIn", "TopoDirOut", "TPDir", "TiePWeight", "DataDir", "GCPFilter", "GCPFilterAdd",
    "BOI", "InInstrBlock", "OutInstrBlock",
)  # fmt: skip
TOPO = ("NbIter", "GCP3D", "GCPFilter", "GCPFilterAdd")
"""Those of `TopoAdj`."""


@dataclass(frozen=True)
class Set3D:
    """A folder of 3D points, the factor SG of their sigmas (0: held), and where they go when adjusted."""

    folder: str
    factor: float
    out: str | None = None


@dataclass(frozen=True)
class Set2D:
    """A folder of image measures and their weighting, pixels; None for what is not used."""

    folder: str
    sigma: float
    attenuation: float | None = None
    threshold: float | None = None
    exponent: float = 1.0


@dataclass(frozen=True)
class InstrumentOptions:
    """The instrument block of `BOI`.

    Attributes:
        folder: of `InstrBlock`.
        block: its name; empty for the only one of the folder.
        factors: of the sigmas of translations and of matrix entries in the file, or these sigmas themselves.
        save: whether the sigmas that were observed are written.
        relative: whether the factors are of the sigmas of the file.
        out: folder that is written; None for none.
    """

    folder: str
    block: str = ""
    factors: tuple[float, float] = (1.0, 1.0)
    save: bool = True
    relative: bool = True
    out: str | None = None


@dataclass(frozen=True)
class BundleOptions:
    """What was asked for; names are MMVII's options in words.

    Attributes:
        freed: (pattern of cameras, pattern of parameters, sigma or None) of `PPFreeCal`.
        shared: (pattern of cameras, pattern of parameters) of `SharedIP`.
        reference: folder, sigma of centres, sigma of rotations or None, pattern of images.
        rigid: sigmas of translations and of matrix entries (`BRW`).
        rigid_places: the same for the places in the block (`BRW_Rat`).
        chosen_names: pattern of the names of 3D points; empty for all (`GCPFilter`).
        chosen_information: pattern of their additional information (`GCPFilterAdd`).
    """

    iterations: int | None = None
    points: tuple[Set3D, ...] = ()
    measures: tuple[Set2D, ...] = ()
    frozen: str | None = None
    freed: tuple[tuple[str, str, float | None], ...] = ()
    shared: tuple[tuple[str, str], ...] = ()
    fixed_centres: str | None = None
    fixed_rotations: str | None = None
    viscosity: tuple[float | None, float | None] | None = None
    reference: tuple[str, float, float | None, str] | None = None
    rigid_folder: str | None = None
    rigid: tuple[float, float] | None = None
    rigid_places: tuple[float, float] | None = None
    rigid_out: str | None = None
    survey: str | None = None
    survey_out: str | None = None
    chosen_names: str = ""
    chosen_information: str = ""
    ties: tuple[Set2D, ...] = field(default=())
    instrument: InstrumentOptions | None = None


def parse_options(words: Sequence[str], known: Sequence[str] = KNOWN) -> BundleOptions:
    """The options of words `Name=value`, with names that are known.

    Raises:
        InputError: a name is not known, comes twice, or its value is not what it takes.
    """
    given: dict[str, Value] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or name not in known:
            raise InputError(f"{word!r} is no option; they are Name=value, with {', '.join(known)}")
        if name in given:
            raise InputError(f"option {name} is given twice")
        given[name] = parse_value(text, name)
    folder = _text(given, "DataDir") or "Std"
    rigid = _numbers(given, "BRW", 2)
    if rigid is None and {"BRDirIn", "BRW_Rat", "OutRigBlock"} & set(given):
        raise InputError("BRDirIn, BRW_Rat and OutRigBlock have no effect without BRW=[SigTr,SigRot]")
    if {"TopoDirOut"} & set(given) and "TopoDirIn" not in given:
        raise InputError("TopoDirOut has no effect without TopoDirIn")
    points, measures = _point_sets(given)
    return BundleOptions(
        iterations=_integer(given, "NbIter"),
        points=points,
        measures=measures,
        frozen=_text(given, "PPFzCal"),
        freed=tuple(
            (_plain(row, 0), _plain(row, 1), _inverse_root(row)) for row in _rows(given, "PPFreeCal", 2, 3)
        ),
        shared=_shared(given),
        fixed_centres=_text(given, "PatFzCenters"),
        fixed_rotations=_text(given, "PatFzOrient"),
        viscosity=_viscosity(given),
        reference=_reference(given),
        rigid_folder=(_text(given, "BRDirIn") or folder) if rigid else None,
        rigid=rigid,
        rigid_places=_numbers(given, "BRW_Rat", 2),
        rigid_out=_text(given, "OutRigBlock"),
        survey=_text(given, "TopoDirIn"),
        survey_out=_text(given, "TopoDirOut"),
        chosen_names=_text(given, "GCPFilter") or "",
        chosen_information=_text(given, "GCPFilterAdd") or "",
        ties=_ties(given, folder),
        instrument=_instrument(given, folder),
    )


def parse_value(text: str, name: str) -> Value:
    """A word, or a list of values in brackets: `[[a,1],[b,2]]`."""
    value, rest = _read(text, name)
    if rest:
        raise InputError(f"{name}={text}: {rest!r} is left over; lists are [a,b,[c,d]]")
    return value


def _read(text: str, name: str) -> tuple[Value, str]:
    if not text.startswith("["):
        return text, ""
    items: list[Value] = []
    rest = text[1:]
    while not rest.startswith("]"):
        if rest.startswith("["):
            item, rest = _read(rest, name)
        else:
            end = min((place for place in (rest.find(c) for c in ",]") if place >= 0), default=-1)
            if end < 0:
                raise InputError(f"{name}={text}: a bracket is not closed")
            item, rest = rest[:end], rest[end:]
        items.append(item)
        if rest.startswith(","):
            rest = rest[1:]
        elif not rest.startswith("]"):
            raise InputError(f"{name}={text}: a bracket is not closed")
    return items, rest[1:]


def _point_sets(given: dict[str, Value]) -> tuple[tuple[Set3D, ...], tuple[Set2D, ...]]:
    """3D and 2D sets of either spelling."""
    old = {"GCPDir", "GCPW", "AddGCPW", "GCPDirOut"} & set(given)
    if old and {"GCP3D", "GCP2D"} & set(given):
        raise InputError(f"{min(old)} is the spelling of 2024, GCP3D and GCP2D that of today: use one")
    if not old:
        points = tuple(
            Set3D(_plain(row, 0), _number(row, 1, "GCP3D"), _plain(row, 2) if len(row) > 2 else None)
            for row in _rows(given, "GCP3D", 2, 3)
        )
        return points, tuple(_set2d(row, "GCP2D") for row in _rows(given, "GCP2D", 2, 5))
    folder, weights = _text(given, "GCPDir"), given.get("GCPW")
    if folder is None or not isinstance(weights, list):
        raise InputError("GCPDir=Folder and GCPW=[SG,SI,...] go together")
    rows: list[list[Value]] = [[folder, *weights], *_rows(given, "AddGCPW", 3, 6)]
    outs = [_text(given, "GCPDirOut"), *([None] * (len(rows) - 1))]
    points = tuple(
        Set3D(_plain(row, 0), _number(row, 1, "GCPW"), out) for row, out in zip(rows, outs, strict=True)
    )
    return points, tuple(_set2d([row[0], *row[2:]], "GCPW") for row in rows)


def _set2d(row: Sequence[Value], name: str) -> Set2D:
    numbers = [_number(row, k, name) for k in range(1, len(row))]
    more = [value if value > 0.0 else None for value in numbers[1:3]] + [None] * (3 - len(numbers))
    return Set2D(_plain(row, 0), numbers[0], more[0], more[1], numbers[3] if len(numbers) > 3 else 1.0)


def _ties(given: dict[str, Value], folder: str) -> tuple[Set2D, ...]:
    weights = given.get("TiePWeight")
    if weights is None:
        if "TPDir" in given:
            raise InputError("TPDir has no effect without TiePWeight=[S0,...]")
        return ()
    if not isinstance(weights, list) or not 1 <= len(weights) <= 4:
        raise InputError("TiePWeight=[S0,At?,Thr?,Exp?] takes one to four numbers")
    return (_set2d([_text(given, "TPDir") or folder, *weights], "TiePWeight"),)


def _instrument(given: dict[str, Value], folder: str) -> InstrumentOptions | None:
    lists = given.get("BOI")
    if lists is None:
        if {"InInstrBlock", "OutInstrBlock"} & set(given):
            raise InputError("InInstrBlock and OutInstrBlock have no effect without BOI=[[Block,mTr,mRot]]")
        return None
    if not isinstance(lists, list) or not 1 <= len(lists) <= 3 or not isinstance(lists[0], list):
        raise InputError("BOI=[[Block?,mTr?,mRot?,Save?,Rel?],[gTr?,gRot?]] takes lists in brackets")
    soft = [_number(row, k, "BOI") for row in lists[1:2] if isinstance(row, list) for k in range(len(row))]
    if len(lists) > 2 or any(value > 0.0 for value in soft):
        raise InputError(
            "BOI: a soft gauge (gTr, gRot above zero) and the attachment to the initial block (third list) "
            "are there from Python only: RigidBlock(master_sigmas=, place_sigmas=)"
        )
    row = lists[0]
    if len(row) > 5:
        raise InputError("BOI: the first list takes Block, mTr, mRot, Save and Rel")
    factors = [_number(row, k, "BOI") if len(row) > k else 1.0 for k in (1, 2)]
    if min(factors) <= 0.0:
        raise InputError("BOI: mTr and mRot must be above zero")
    save, relative = (_flag(row, k) for k in (3, 4))
    return InstrumentOptions(
        _text(given, "InInstrBlock") or folder,
        _plain(row, 0) if row else "",
        (factors[0], factors[1]),
        save,
        relative,
        _text(given, "OutInstrBlock"),
    )


def _flag(row: Sequence[Value], place: int) -> bool:
    word = _plain(row, place) if len(row) > place else "true"
    if word not in ("0", "1", "true", "false"):
        raise InputError(f"BOI: {word!r} is neither true nor false")
    return word in ("1", "true")


def _shared(given: dict[str, Value]) -> tuple[tuple[str, str], ...]:
    words = given.get("SharedIP", [])
    if not isinstance(words, list) or len(words) % 2:
        raise InputError("SharedIP=[PatCam1,PatPar1,PatCam2,...] takes pairs of patterns")
    return tuple((_plain(words, k), _plain(words, k + 1)) for k in range(0, len(words), 2))


def _viscosity(given: dict[str, Value]) -> tuple[float | None, float | None] | None:
    numbers = _numbers(given, "PoseVisc", 2)
    if numbers is None:
        return None
    first, second = (value if value > 0.0 else None for value in numbers)
    return first, second


def _reference(given: dict[str, Value]) -> tuple[str, float, float | None, str] | None:
    row = given.get("RefOri")
    if row is None:
        return None
    if not isinstance(row, list) or not 2 <= len(row) <= 4:
        raise InputError("RefOri=[Ori,SigTr,SigRot?,Pat?] takes two to four values")
    turn = _number(row, 2, "RefOri") if len(row) > 2 else -1.0
    pattern = _plain(row, 3) if len(row) > 3 else ".*"
    return _plain(row, 0), _number(row, 1, "RefOri"), turn if turn > 0.0 else None, pattern


def _inverse_root(row: Sequence[Value]) -> float | None:
    """The sigma of a weight, where one is given."""
    weight = _number(row, 2, "PPFreeCal") if len(row) > 2 else -1.0
    return weight**-0.5 if weight > 0.0 else None


def _rows(given: dict[str, Value], name: str, least: int, most: int) -> list[list[Value]]:
    value = given.get(name, [])
    if isinstance(value, list) and value and not isinstance(value[0], list):
        value = [value]
    if not isinstance(value, list):
        raise InputError(f"{name}={value}: a list in brackets is needed, [[...],...]")
    rows = [row for row in value if isinstance(row, list) and least <= len(row) <= most]
    if len(rows) < len(value):
        raise InputError(f"{name}: each element takes {least} to {most} values in brackets")
    return rows


def _numbers(given: dict[str, Value], name: str, n: int) -> tuple[float, float] | None:
    value = given.get(name)
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != n:
        raise InputError(f"{name} takes {n} numbers in brackets")
    return _number(value, 0, name), _number(value, 1, name)


def _number(row: Sequence[Value], place: int, name: str) -> float:
    word = _plain(row, place)
    try:
        return float(word)
    except ValueError:
        raise InputError(f"{name}: {word!r} is not a number") from None


def _plain(row: Sequence[Value], place: int) -> str:
    value = row[place]
    if not isinstance(value, str):
        raise InputError(f"a name or a number is needed, not the list {value}")
    return value


def _text(given: dict[str, Value], name: str) -> str | None:
    value = given.get(name)
    if isinstance(value, list):
        raise InputError(f"{name} takes one word, not a list")
    return None if value in (None, "NONE") else value


def _integer(given: dict[str, Value], name: str) -> int | None:
    word = _text(given, name)
    if word is None:
        return None
    if not (word.isdecimal() and int(word) > 0):
        raise InputError(f"{name}={word} is not a whole number above zero")
    return int(word)

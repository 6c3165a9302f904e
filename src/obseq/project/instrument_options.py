"""The options of MMVII's instrument blocks: `BOI`, `ClinoBOI`, and their folders."""

from __future__ import annotations

from typing import TYPE_CHECKING

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.project.option_values import flag_or, number_or, text_of, word_at

if TYPE_CHECKING:
    from collections.abc import Mapping

    from obseq.project.option_values import Value

BLOCK = "BOI=[[Block?,mTr?,mRot?,Save?,Rel?],[gTr?,gRot?],[cTr,cRot]?]"
TILTS = "ClinoBOI=[[Block?,mAng?,mOrth?],[VertFree?,Others?],[Degree 0?,Degree 1?,...]]"
NAMES = ("BOI", "ClinoBOI", "InInstrBlock", "OutInstrBlock", "InMeasureClino")


@dataclass(frozen=True)
class ClinometerOptions:
    """The clinometers of a block, `ClinoBOI`.

    Attributes:
        folder: of `MeasureClino`.
        factors: of the sigmas of readings, and of right angles, that the files give.
        vertical_is_free: whether the vertical is an unknown.
        others: whether readings without an image are left aside (they are an error otherwise).
        free_degrees: of the corrections, that are unknowns.
    """

    folder: str
    factors: tuple[float, float] = (1.0, 1.0)
    vertical_is_free: bool = False
    others: bool = False
    free_degrees: tuple[int, ...] = ()


@dataclass(frozen=True)
class InstrumentOptions:
    """The instrument block of `BOI`.

    Attributes:
        folder: of `InstrBlock`.
        block: its name; empty for the only one of the folder.
        factors: of the sigmas of translations and of matrix entries in the file, or these sigmas themselves.
        save: whether the sigmas that were observed are written.
        relative: whether the factors are of the sigmas of the file.
        gauge: of the master, times its sigmas of the file; it is held where it is not above zero.
        attachment: of all places to those of the file, times their sigmas there; None: they are free.
        clinometers: None when they do not join.
        out: folder that is written; None for none.
    """

    folder: str
    block: str = ""
    factors: tuple[float, float] = (1.0, 1.0)
    save: bool = True
    relative: bool = True
    gauge: tuple[float, float] = (0.0, 0.0)
    attachment: tuple[float, float] | None = None
    clinometers: ClinometerOptions | None = None
    out: str | None = None


def instrument_options(given: Mapping[str, Value], folder: str) -> InstrumentOptions | None:
    """The instrument block that options name; None without `BOI`.

    Raises:
        InputError: a list is not what it should be, or would have no effect.
    """
    if "BOI" not in given:
        alone = [name for name in NAMES if name in given]
        if alone:
            raise InputError(f"{alone[0]} has no effect without {BLOCK}")
        return None
    pairs, gauge, attachment = _lists(given["BOI"], BLOCK, (5, 2, 2))
    factors = _positive(pairs, "mTr and mRot")
    return InstrumentOptions(
        text_of(given, "InInstrBlock") or folder,
        word_at(pairs, 0) if pairs else "",
        factors,
        flag_or(pairs, 3, "BOI", True),
        flag_or(pairs, 4, "BOI", True),
        (number_or(gauge, 0, "BOI", 0.0), number_or(gauge, 1, "BOI", 0.0)),
        _positive(["", *attachment], "cTr and cRot") if attachment else None,
        _clinometers(given, folder, word_at(pairs, 0) if pairs else ""),
        text_of(given, "OutInstrBlock"),
    )


def _clinometers(given: Mapping[str, Value], folder: str, block: str) -> ClinometerOptions | None:
    if "ClinoBOI" not in given:
        if "InMeasureClino" in given:
            raise InputError(f"InMeasureClino has no effect without {TILTS}")
        return None
    names, vertical, degrees = _lists(given["ClinoBOI"], TILTS, (3, 2, 4))
    own = word_at(names, 0) if names else ""
    if own and own != block:
        raise InputError(
            f"ClinoBOI names the block {own}, BOI names {block or 'none'}: they are of one block"
        )
    return ClinometerOptions(
        text_of(given, "InMeasureClino") or folder,
        _positive(names, "mAng and mOrth"),
        flag_or(vertical, 0, "ClinoBOI", False),
        flag_or(vertical, 1, "ClinoBOI", False),
        tuple(k for k in range(len(degrees)) if flag_or(degrees, k, "ClinoBOI", False)),
    )


def _lists(value: Value, form: str, most: tuple[int, ...]) -> list[list[Value]]:
    """The lists of an option, as many as it can have, and empty ones for those that are not given."""
    lists = [part for part in value if isinstance(part, list)] if isinstance(value, list) else []
    if not lists or len(lists) != len(value) or len(lists) > len(most):
        raise InputError(f"{form} takes lists in brackets")
    lists += [[] for _ in range(len(most) - len(lists))]
    if any(len(part) > n for part, n in zip(lists, most, strict=True)):
        raise InputError(f"{form}: a list has more values than these")
    return lists


def _positive(row: list[Value], names: str) -> tuple[float, float]:
    """The second and the third value of a list, 1 where it has none."""
    first, second = (number_or(row, k, names, 1.0) for k in (1, 2))
    if min(first, second) <= 0.0:
        raise InputError(f"BOI: {names} must be above zero")
    return first, second

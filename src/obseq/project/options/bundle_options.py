"""The options of MMVII's `OriBundleAdj`, as it writes them: `GCP3D=[[Terrain,1]] BRW=[1e-2,1e-5]`.

Both spellings are understood: that of 2026, and that of 2024 (`GCPDir`, `GCPW`, `AddGCPW`, `GCPDirOut`). What
is not understood, or would have no effect, is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.project.options.option_values import (
    Value,
    flag_or,
    number_at,
    number_or,
    parse_value,
    rows_of,
    text_of,
    two_numbers,
    whole_number,
    word_at,
)

BLOCK = "BOI=[[Block?,mTr?,mRot?,Save?,Rel?],[gTr?,gRot?],[cTr,cRot]?]"
TILTS = "ClinoBOI=[[Block?,mAng?,mOrth?],[VertFree?,Others?],[Degree 0?,Degree 1?,...]]"
INSTRUMENTS = ("BOI", "ClinoBOI", "InInstrBlock", "OutInstrBlock", "InMeasureClino")
BORESIGHTS = ("ClinoDirIn", "ClinoDirOut")

KNOWN = (
    "NbIter", "GCP3D", "GCP2D", "GCPDir", "GCPW", "AddGCPW", "GCPDirOut", "PPFzCal", "PPFreeCal", "SharedIP",
    "PatFzCenters", "PatFzOrient", "PoseVisc", "RefOri", "BRDirIn", "BRW", "BRW_Rat", "OutRigBlock",
    "TopoDirIn", "TopoDirOut", "TopoW", "TopoRefr", "TPDir", "TiePWeight", "DataDir", "GCPFilter",
    "GCPFilterAdd",
    *INSTRUMENTS, *BORESIGHTS,
)  # fmt: skip
TOPO = ("NbIter", "GCP3D", "GCPDir", "GCPW", "GCPDirOut", "GCPFilter", "GCPFilterAdd", "TopoRefr")
"""Those of `TopoAdj`."""


@dataclass(frozen=True)
class Set3D:
    """A folder of 3D points, the factor SG of their sigmas (0: held), and where they go when adjusted.

    In the spelling of 2024 the measures in images of that folder go along.
    """

    folder: str
    factor: float
    out: str | None = None
    with_measures: bool = False


@dataclass(frozen=True)
class Set2D:
    """A folder of image measures and their weighting, pixels; None for what is not used.

    Without a sigma (SI 0), measures have the variances and covariances of their files.
    """

    folder: str
    sigma: float | None
    attenuation: float | None = None
    threshold: float | None = None
    exponent: float = 1.0


@dataclass(frozen=True)
class BundleOptions:
    """What was asked for; names are MMVII's options in words.

    Attributes:
        freed: (pattern of cameras, pattern of parameters, sigma or None) of `PPFreeCal`.
        shared: (pattern of cameras, pattern of parameters) of `SharedIP`.
        reference: folder, sigma of centres, sigma of rotations or None, pattern of images.
        rigid: sigmas of translations and of matrix entries (`BRW`).
        survey_weight: factor of the weights of all survey observations (`TopoW`).
        refraction: coefficient of zenith angles; None for the usual one (`TopoRefr`).
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
    survey_weight: float = 1.0
    refraction: float | None = None
    chosen_names: str = ""
    chosen_information: str = ""
    ties: tuple[Set2D, ...] = field(default=())
    instrument: InstrumentOptions | None = None
    boresights: BoresightOptions | None = None


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
    folder = text_of(given, "DataDir") or "Std"
    rigid = two_numbers(given, "BRW")
    if rigid is None and {"BRDirIn", "BRW_Rat", "OutRigBlock"} & set(given):
        raise InputError("BRDirIn, BRW_Rat and OutRigBlock have no effect without BRW=[SigTr,SigRot]")
    if {"TopoDirOut"} & set(given) and "TopoDirIn" not in given:
        raise InputError("TopoDirOut has no effect without TopoDirIn")
    points, measures = _point_sets(given, has_images=known is KNOWN)
    return BundleOptions(
        iterations=whole_number(given, "NbIter"),
        points=points,
        measures=measures,
        frozen=text_of(given, "PPFzCal"),
        freed=tuple(
            (word_at(row, 0), word_at(row, 1), _inverse_root(row))
            for row in rows_of(given, "PPFreeCal", 2, 3)
        ),
        shared=_shared(given),
        fixed_centres=text_of(given, "PatFzCenters"),
        fixed_rotations=text_of(given, "PatFzOrient"),
        viscosity=_viscosity(given),
        reference=_reference(given),
        rigid_folder=(text_of(given, "BRDirIn") or folder) if rigid else None,
        rigid=rigid,
        rigid_places=two_numbers(given, "BRW_Rat"),
        rigid_out=text_of(given, "OutRigBlock"),
        survey=text_of(given, "TopoDirIn"),
        survey_out=text_of(given, "TopoDirOut"),
        survey_weight=_weight(given),
        refraction=number_at([given["TopoRefr"]], 0, "TopoRefr") if "TopoRefr" in given else None,
        chosen_names=text_of(given, "GCPFilter") or "",
        chosen_information=text_of(given, "GCPFilterAdd") or "",
        ties=_ties(given, folder),
        instrument=instrument_options(given, folder),
        boresights=_boresights(given, folder),
    )


def _point_sets(given: dict[str, Value], *, has_images: bool) -> tuple[tuple[Set3D, ...], tuple[Set2D, ...]]:
    """3D and 2D sets of either spelling."""
    old = {"GCPDir", "GCPW", "AddGCPW", "GCPDirOut"} & set(given)
    if old and {"GCP3D", "GCP2D"} & set(given):
        raise InputError(f"{min(old)} is the spelling of 2024, GCP3D and GCP2D that of today: use one")
    if not old:
        points = tuple(
            Set3D(word_at(row, 0), number_at(row, 1, "GCP3D"), word_at(row, 2) if len(row) > 2 else None)
            for row in rows_of(given, "GCP3D", 2, 3)
        )
        return points, tuple(_set2d(row, "GCP2D") for row in rows_of(given, "GCP2D", 2, 5))
    folder, weights = text_of(given, "GCPDir"), given.get("GCPW", [] if has_images else ["1"])
    if isinstance(weights, str) and not has_images:
        weights = [weights]
    if folder is None or not isinstance(weights, list) or len(weights) < 1 + has_images:
        raise InputError("GCPDir=Folder and GCPW=[SG,SI,...] go together")
    rows: list[list[Value]] = [[folder, *weights], *rows_of(given, "AddGCPW", 3, 6)]
    outs = [text_of(given, "GCPDirOut"), *([None] * (len(rows) - 1))]
    points = tuple(
        Set3D(word_at(row, 0), number_at(row, 1, "GCPW"), out, with_measures=has_images)
        for row, out in zip(rows, outs, strict=True)
    )
    if not has_images:
        return points, ()
    return points, tuple(_set2d([row[0], *row[2:]], "GCPW") for row in rows)


def _set2d(row: Sequence[Value], name: str) -> Set2D:
    numbers = [number_at(row, k, name) for k in range(1, len(row))]
    more = [value if value > 0.0 else None for value in numbers[1:3]] + [None] * (3 - len(numbers))
    if numbers[0] == 0.0 and len(numbers) > 1:
        raise InputError(f"{name}: SI 0 takes the covariances of the files, and no At, Thr, Exp beside")
    return Set2D(
        word_at(row, 0), numbers[0] or None, more[0], more[1], numbers[3] if len(numbers) > 3 else 1.0
    )


def _ties(given: dict[str, Value], folder: str) -> tuple[Set2D, ...]:
    weights = given.get("TiePWeight")
    if weights is None:
        if "TPDir" in given:
            raise InputError("TPDir has no effect without TiePWeight=[S0,...]")
        return ()
    if not isinstance(weights, list) or not 1 <= len(weights) <= 4:
        raise InputError("TiePWeight=[S0,At?,Thr?,Exp?] takes one to four numbers")
    return (_set2d([text_of(given, "TPDir") or folder, *weights], "TiePWeight"),)


def _shared(given: dict[str, Value]) -> tuple[tuple[str, str], ...]:
    words = given.get("SharedIP", [])
    if not isinstance(words, list) or len(words) % 2:
        raise InputError("SharedIP=[PatCam1,PatPar1,PatCam2,...] takes pairs of patterns")
    return tuple((word_at(words, k), word_at(words, k + 1)) for k in range(0, len(words), 2))


def _viscosity(given: dict[str, Value]) -> tuple[float | None, float | None] | None:
    numbers = two_numbers(given, "PoseVisc")
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
    turn = number_at(row, 2, "RefOri") if len(row) > 2 else -1.0
    pattern = word_at(row, 3) if len(row) > 3 else ".*"
    return word_at(row, 0), number_at(row, 1, "RefOri"), turn if turn > 0.0 else None, pattern


def _weight(given: dict[str, Value]) -> float:
    """The factor of the weights of the survey."""
    if "TopoW" not in given:
        return 1.0
    weight = number_at([given["TopoW"]], 0, "TopoW")
    if not weight > 0.0 or "TopoDirIn" not in given:
        raise InputError("TopoW is above zero, and goes with TopoDirIn")
    return weight


def _inverse_root(row: Sequence[Value]) -> float | None:
    """The sigma of a weight, where one is given."""
    weight = number_at(row, 2, "PPFreeCal") if len(row) > 2 else -1.0
    return weight**-0.5 if weight > 0.0 else None


@dataclass(frozen=True)
class BoresightOptions:
    """Clinometers as they were before blocks.

    Attributes:
        folder: of `Clino`.
        readings: folder of `MeasureClino`.
        out: folder of `Clino` that is written; None for none.
    """

    folder: str
    readings: str
    out: str | None = None


def _boresights(given: Mapping[str, Value], folder: str) -> BoresightOptions | None:
    name = text_of(given, "ClinoDirIn")
    if name is None:
        if "ClinoDirOut" in given:
            raise InputError("ClinoDirOut has no effect without ClinoDirIn")
        return None
    return BoresightOptions(name, text_of(given, "InMeasureClino") or folder, text_of(given, "ClinoDirOut"))


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
        used = {"InMeasureClino"} if "ClinoDirIn" in given else set[str]()
        alone = [name for name in INSTRUMENTS if name in given and name not in used]
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
        if "InMeasureClino" in given and "ClinoDirIn" not in given:
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

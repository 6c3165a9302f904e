"""Observations of SNAP as records, which mean the same as those of DynAdjust."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace
from pathlib import Path

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.formats.dynadjust.records import Header, MeasurementRecord, Member, Place
from obseq.formats.snap.commands import Job
from obseq.formats.snap.lines import ANGLES, ERRORS, LENGTHS, VECTORS, DataFile, Sight, Together
from obseq.formats.snap.places import Places
from obseq.reading.text import TextFile, quoted, read_text

CODES = {"SD": "S", "HD": "C", "ED": "E", "MD": "C", "DR": "S", "ZD": "V", "AZ": "B", "PB": "B", "LV": "L"}
CODES |= {"OH": "H", "EH": "R", "LT": "P", "LN": "Q", "GB": "G", "GX": "Y"}
"""Types of DynAdjust's records, by data type; sets of directions are D."""
OF_HEIGHTS = ("OH", "EH")
PARAMETERS_OF = {
    "reference_frame": VECTORS,
    "distance_scale_error": LENGTHS,
    "bearing_orientation_error": ("AZ", "PB"),
}
"""Data types to which parameters belong."""


@dataclass(frozen=True, eq=False)
class Found:
    """Records of observations, and the sets of distances that share a scale, as positions in `records`."""

    records: list[MeasurementRecord] = field(default_factory=list)
    ratios: list[list[int]] = field(default_factory=list)


def read_observations(path: Path, job: Job, factor: float, found: Found) -> None:
    """Adds the observations of a data file.

    Args:
        path: The file.
        job: Stations, and what is left out.
        factor: Of the standard errors.
        found: What is added to.

    Raises:
        InputError: Naming file and line, what is wrong.
    """
    file = read_text(path, job.folder.encoding)
    records = _Records(file, job, factor, found)
    for together in DataFile(file).read():
        records.add(together)


class _Records:
    def __init__(self, file: TextFile, job: Job, factor: float, found: Found) -> None:
        assert job.system is not None
        self._file, self._job, self._factor, self._found = file, job, factor, found
        self._places = Places(job.marks, job.system)
        self._header = Header(job.system.datum)

    def add(self, together: Together) -> None:
        """Adds the records of one observation, or of a set."""
        code = together.sights[0].code
        changes = [change for codes, change in self._job.changes if code in codes]
        if 0.0 in changes:
            return
        if not all(map(math.isfinite, changes)):
            off = tuple(replace(sight, is_active=False) for sight in together.sights)
            together = replace(together, sights=off)
        kept = [sight for sight in together.sights if not self._is_dropped(sight)]
        if not kept:
            return
        self._check_parameters(kept[0], together)
        factor = self._factor * math.prod(change for change in changes if math.isfinite(change))
        first = len(self._found.records)
        if code in VECTORS:
            self._found.records.append(self._cluster(together, kept, factor))
        elif code == "HA":
            self._found.records.append(self._directions(together, kept, factor))
        else:
            self._found.records.extend([self._single(sight, together, factor) for sight in kept])
        if code == "DR":
            self._found.ratios.append(list(range(first, len(self._found.records))))

    def _is_dropped(self, sight: Sight) -> bool:
        """Whether a station of it takes no part; one that is nowhere is an error unless such are left out."""
        unknown = [name for name in sight.ends if name not in self._job.marks]
        if unknown and not self._job.ignores_missing:
            raise self._file.error(sight.index, f"station {quoted(unknown[0])} is in no coordinate file")
        return bool(unknown) or any(name in self._job.dropped for name in sight.ends)

    def _check_parameters(self, sight: Sight, together: Together) -> None:
        """Refuses observations with parameters that nothing here takes from the command file."""
        given = {"reference_frame": "gps", **together.settings.parameters}
        for name, codes in PARAMETERS_OF.items():
            value = given.get(name, "")
            command = self._job.modelled.get((name, value)) if sight.code in codes else None
            if command is not None:
                raise command.error(
                    f"{value} has parameters, which are not taken from here: remove the command, or its "
                    "observations; scales and constants of instruments are asked for with --estimate"
                )
        coefficient, known = given.get("refraction_coefficient") or "default", self._job.refractions
        if sight.code == "ZD" and known.get(coefficient, known["default"]) != known["default"]:
            raise self._file.error(sight.index, f"refraction coefficient {coefficient}: one for all is read")

    def _place(self, sight: Sight) -> Place:
        return Place(self._file.name, sight.index + 1)

    def _sigma(self, sight: Sight, together: Together, value: float) -> float:
        """The standard error of a single observation (m, rad)."""
        if sight.errors is not None:
            return sight.errors[0]
        parts = together.settings.defaults.get(sight.code)
        if parts is None:
            command = next(name for name, (_, codes) in ERRORS.items() if sight.code in codes)
            raise self._file.error(
                sight.index, f"the standard error of {sight.code} is nowhere: #{command} says it"
            )
        share = {"ppm": value, "mm": 1.0, "sec": 1.0}
        if sight.code in ANGLES and set(parts) - {"sec"}:
            flat, slope = self._places.lengths(sight)
            share |= {"mm": 1.0 / flat, "mmh": math.cos(value) / slope, "mmv": math.sin(value) / slope}
        return math.hypot(*(numbers[0] * share[unit] for unit, numbers in parts.items()))

    def _single(self, sight: Sight, together: Together, factor: float) -> MeasurementRecord:
        (value,) = sight.values
        sigma = self._sigma(sight, together, value) * factor
        if sight.code in ("HD", "MD"):
            value = self._places.chord(sight)
        elif sight.code == "PB":
            if together.settings.projection is None:
                raise self._file.error(sight.index, "#projection says in which grid a bearing is")
            value += self._places.convergence(sight, together.settings.projection)
        elif sight.code in OF_HEIGHTS:
            value -= sight.heights[0]
        return MeasurementRecord(
            CODES[sight.code],
            sight.is_active,
            sight.ends,
            value,
            sigma,
            (0.0, 0.0) if sight.code in OF_HEIGHTS else sight.heights,
            header=self._header,
            place=self._place(sight),
        )

    def _directions(self, together: Together, sights: Sequence[Sight], factor: float) -> MeasurementRecord:
        members = tuple(
            Member(
                sight.ends,
                sight.values,
                self._sigma(sight, together, 0.0) * factor,
                None,
                (),
                sight.is_active,
                self._place(sight),
            )
            for sight in sights
        )
        first = sights[0].ends[:1]
        return MeasurementRecord(
            "D", True, first, members=members, header=self._header, place=members[0].place
        )

    def _cluster(self, together: Together, kept: Sequence[Sight], factor: float) -> MeasurementRecord:
        """A vector or position, or a set of them: what is rejected is left out of its covariance."""
        sights = together.sights
        covariance = self._covariance(together) * factor**2
        active = [k for k, sight in enumerate(sights) if sight in kept and sight.is_active]
        chosen = active or [sights.index(sight) for sight in kept]
        parts = [slice(3 * k, 3 * k + 3) for k in chosen]
        members = [
            Member(
                sights[k].ends,
                sights[k].values,
                math.nan,
                covariance[own, own],
                tuple(covariance[own, other] for other in parts[position + 1 :]),
                True,
                self._place(sights[k]),
            )
            for position, (k, own) in enumerate(zip(chosen, parts, strict=True))
        ]
        first = sights[chosen[0]]
        return MeasurementRecord(
            CODES[first.code],
            bool(active),
            first.ends[:1],
            heights=first.heights,
            members=tuple(members),
            header=self._header,
            place=members[0].place,
        )

    def _covariance(self, together: Together) -> FloatArray:
        """(3 n, 3 n) of a set along geocentric axes."""
        sights, triangle, form = together.sights, together.triangle, together.settings.form
        n = 3 * len(sights)
        if sights[0].errors is None:
            return self._of_defaults(together)
        if form == "full" and not sights[0].errors:
            if not triangle:
                raise self._file.error(
                    sights[-1].index, "the matrix of this set is missing; #end_set begins it"
                )
            return _symmetric(n, triangle, 0)
        blocks = np.zeros((n, n))
        for k, sight in enumerate(sights):
            own = slice(3 * k, 3 * k + 3)
            blocks[own, own] = self._of_one(sight, form)
        if triangle and form == "correlation":
            sizes = np.sqrt(np.diag(blocks))
            return np.asarray((_symmetric(n, triangle, -1) + np.eye(n)) * np.outer(sizes, sizes))
        return blocks

    def _of_one(self, sight: Sight, form: str) -> FloatArray:
        """(3, 3) of one vector or position."""
        numbers = sight.errors or ()
        if form == "full" and len(numbers) == 6:
            return _symmetric(3, numbers, 0)
        squares = np.diag(np.square(numbers[:3]))
        if len(numbers) == 6:
            sizes = np.outer(numbers[:3], numbers[:3])
            return np.asarray((_symmetric(3, numbers[3:], -1) + np.eye(3)) * sizes)
        if form == "enu" or form == "full":  # "full": after the word error, which is of east, north and up
            axes = self._places.axes([sight])
            return np.asarray(axes @ squares @ axes.T)
        return squares

    def _of_defaults(self, together: Together) -> FloatArray:
        """(3 n, 3 n) of errors to east, north and up of vectors between any two stations of a set."""
        sights = together.sights
        parts = together.settings.defaults.get(sights[0].code)
        if parts is None or any(len(numbers) != 3 for numbers in parts.values()):
            name = "gps_enu_error" if sights[0].code == "GB" else "gx_enu_error"
            raise self._file.error(
                sights[0].index, f"the standard errors are nowhere: #{name} says them, three of a unit"
            )
        ends = np.array([sight.values for sight in sights])
        squares = np.sum((ends[:, None] - ends[None]) ** 2, axis=2)[:, :, None]
        fixed, share, common, apart = (
            np.square(parts.get(unit, [0.0] * 3)) for unit in ("mm", "ppm", "mmr", "ppmr")
        )
        n = len(sights)
        if sights[0].code == "GB":
            own = fixed + share * np.sum(ends**2, axis=1)[:, None]
            apart_of = np.where(squares > 0.0, fixed + share * squares, 0.0)
            between = (own[:, None] + own[None] - apart_of) / 2.0
            axes = self._places.axes(sights)
            return np.asarray(np.einsum("ia,kla,ja->kilj", axes, between, axes).reshape(3 * n, 3 * n))
        between = common + apart * squares
        between[np.arange(n), np.arange(n)] = fixed
        turns = np.array([self._places.axes([sight]) for sight in sights])
        later = np.maximum(np.arange(n)[:, None], np.arange(n))  # SNAP's axes are those of the later one
        whole = np.einsum("klia,kla,klja->kilj", turns[later], between, turns[later])
        return np.asarray(whole.reshape(3 * n, 3 * n))


def _symmetric(n: int, numbers: Sequence[float], diagonal: int) -> FloatArray:
    """(n, n) of a lower triangle by rows, its diagonal or what is below it first."""
    matrix = np.zeros((n, n))
    matrix[np.tril_indices(n, diagonal)] = numbers
    return np.asarray(matrix + np.tril(matrix, -1).T)

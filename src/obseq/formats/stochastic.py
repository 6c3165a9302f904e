"""The stochastic model: what observations of named instruments are worth, centring of both ends included.

Standard deviations without centring stand in the observations as they are read. Centring depends on
distances: it is added once the points have their first values. With s of the kind, centring c_i of the
instrument and c_t of the target (m, per axis), c_v of either in height, d between the points, z the zenith
angle, the variances are:

- direction, azimuth: s^2 + (c_i^2 + c_t^2) / d^2, d horizontal;
- angle, with d' to its backsight, u and u' along the sights:
  s^2 + c_t^2 (1/d^2 + 1/d'^2) + c_i^2 |u/d - u'/d'|^2;
- slope distance: (a + b d)^2 + sin^2 z (c_i^2 + c_t^2) + cos^2 z 2 c_v^2;
- horizontal distance: (a + b d)^2 + c_i^2 + c_t^2;
- zenith angle: s^2 + (cos^2 z (c_i^2 + c_t^2) + sin^2 z 2 c_v^2) / d^2.

The index of the vertical circle is set once for a set-up: with its s_x, zenith angles in one face have
s_x^2 more variance, and as much covariance with each other. Means of both faces are free of it.

STAR*NET has the same. Standard errors that stand in its lines hold their centring, unless `.ADDCENTERING` is
on.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obseq.dataclass import dataclass
from obseq.errors import InputError
from obseq.formats.default_sigmas import CENTRING, INDEX, NAMES, quantity
from obseq.reading.text import read_text
from obseq.survey.kinds.directions import ANGLE, AZIM, HZ, ZEN
from obseq.survey.kinds.lengths import DH, DIST, DIST_HZ
from obseq.survey.model import Cluster

if TYPE_CHECKING:
    from obseq.arrays import BoolArray, FloatArray, IntArray
    from obseq.survey.kinds.kind import ObservationKind
    from obseq.survey.model import FieldBook
    from obseq.survey.model import IntArray as Numbers
    from obseq.survey.network import Network

NAME_OF: dict[ObservationKind, str] = {
    ANGLE: "angle",
    AZIM: "azimuth",
    HZ: "direction",
    ZEN: "zenith",
    DIST: "distance",
    DIST_HZ: "distance",
    DH: "height",
}
"""What a standard deviation of each kind is called."""
ROOT = 2.0**0.5
SHEETS: dict[str, dict[str, float]] = {
    "iso-17123-3": {"direction": ROOT, "zenith": ROOT, "angle": 2.0},
    "iso-17123-2": {"height-per-km": ROOT},
}
"""What data sheets say, and what each standard deviation is of it: theirs are of the mean of both faces, and
of levelling there and back; here it is of a reading (of two, for an angle), and of a single run."""
LIBRARY = Path(__file__).with_name("data") / "instruments.toml"
"""Instruments by class."""
SHORTEST = 1e-3
"""Distance (m) below which centring says nothing more: points that coincide so far."""
Sigmas = Mapping[str, float]
"""Standard deviations by name (`default_sigmas.NAMES`), in metres, radians or parts."""


@dataclass(frozen=True)
class StochasticModel:
    """What observations are worth, by instrument.

    Attributes:
        default: Of instruments without a name, or with one that is not here.
        instruments: Of named instruments; what one does not say is that of the default.

    Example:
        >>> model = StochasticModel({"direction": 5e-6}, {"TS": {"direction": 2e-6}})
        >>> model.of("TS")["direction"], model.of("")["direction"]
        (2e-06, 5e-06)
    """

    default: Sigmas = field(default_factory=dict)
    instruments: Mapping[str, Sigmas] = field(default_factory=dict)

    def of(self, instrument: str) -> Sigmas:
        """Standard deviations of an instrument; "" for none."""
        return {**self.default, **self.instruments.get(instrument, {})}

    @property
    def has_centring(self) -> bool:
        """Whether anything depends on the places of points."""
        names = (*CENTRING, INDEX)
        return any(name in given for given in (self.default, *self.instruments.values()) for name in names)

    def weighed(self, book: FieldBook) -> tuple[FieldBook, BoolArray]:
        """The book with the standard deviations of the model in place of its own, and (n,) which have them.

        Observations of kinds of which the model says nothing keep theirs, as do correlated ones. Readings in
        both faces are weighed before they are reduced to their means.
        """
        rows = book.observations
        sigmas, relative = rows.sigmas.copy(), rows.relative_sigmas.copy()
        taken = np.zeros(len(rows), np.bool_)
        free = np.ones(len(rows), np.bool_)
        for cluster in book.clusters:
            free[cluster.rows] = False
        for given, kind, chosen in self._parts(book, free & rows.active):
            name = NAME_OF[kind]
            if name in given:
                sigmas[chosen] = given[name]
                relative[chosen] = given.get("distance-ppm", 0.0) if name == "distance" else 0.0
                taken[chosen] = True
        found = replace(book, observations=replace(rows, sigmas=sigmas, relative_sigmas=relative))
        told = _shares(book, self._parts(found, taken), sigmas, relative)
        text = f"standard deviations of {int(taken.sum())} observations are those of the stochastic model"
        return found.warned(text + told), taken

    def centring(self, network: Network, chosen: BoolArray) -> Network:
        """The network with the centring of instruments and targets in the sigmas of some observations.

        Args:
            network: With standard deviations without centring.
            chosen: (n,) which observations get it.
        """
        rows = network.book.observations
        if not (self.has_centring and chosen.any()):
            return network
        sights = _Sights(network)
        sigmas, relative = rows.sigmas.copy(), rows.relative_sigmas.copy()
        told, lost = [], 0
        for given, kind, alike in self._parts(network.book, chosen & rows.active):
            variances = sights.variances(kind, alike, given)
            placed = np.isfinite(variances)
            lost += int(np.count_nonzero(~placed))
            those = alike[placed]
            share = relative[those] * (sights.lengths(kind, those) if kind in (DIST, DIST_HZ) else 0.0)
            sigmas[those] = np.sqrt((sigmas[those] + share) ** 2 + variances[placed])
            relative[those] = 0.0
            if those.size and given.keys() & {*CENTRING}:
                told.append(_told(kind, sigmas[those]))
        text = f"with centring the standard deviations are: {'; '.join(told)}"
        if lost:
            text += f"; {lost} observations of points without a place are without it"
        observations = replace(rows, sigmas=sigmas, relative_sigmas=relative)
        book = replace(network.book, observations=observations).warned(*([text] if told or lost else []))
        return replace(network, book=self._with_index(book, chosen))

    def _with_index(self, book: FieldBook, chosen: BoolArray) -> FieldBook:
        """The book where zenith angles of a set-up have the setting of the index in common."""
        rows, sigmas = book.observations, book.observations.sigmas.copy()
        both = _of_both_faces(book)
        clusters, count = list(book.clusters), 0
        for given, kind, alike in self._parts(book, chosen & rows.active & ~both):
            if kind is not ZEN or INDEX not in given:
                continue
            for station in np.unique(rows.stations[alike]).tolist():
                own = alike[rows.stations[alike] == station]
                common = given[INDEX] ** 2
                covariance = np.diag(sigmas[own] ** 2) + common
                sigmas[own] = np.hypot(sigmas[own], given[INDEX])
                clusters += [Cluster(own, covariance)] if len(own) > 1 else []
                count += len(own)
        if not count:
            return book
        told = f"the setting of the index is common to the zenith angles of each set-up ({count} in one face)"
        observations = replace(rows, sigmas=sigmas)
        return replace(book, observations=observations, clusters=tuple(clusters)).warned(told)

    def _parts(self, book: FieldBook, chosen: BoolArray) -> list[tuple[Sigmas, ObservationKind, IntArray]]:
        """Observations by instrument and kind: what the model says of them, the kind, the rows."""
        groups: dict[tuple[int, int], list[int]] = defaultdict(list)
        rows = book.observations
        for row in np.flatnonzero(chosen & np.isin(rows.types, [kind.code for kind in NAME_OF])).tolist():
            groups[int(rows.groups[row]), int(rows.types[row])].append(row)
        kinds = {kind.code: kind for kind in NAME_OF}
        names = {-1: "", **{k: group.name for k, group in enumerate(book.groups)}}
        return [
            (self.of(names[group]), kinds[code], np.array(found)) for (group, code), found in groups.items()
        ]


def _of_both_faces(book: FieldBook) -> BoolArray:
    """(n,) zenith angles that are means of both faces: another reading of the sight is switched off."""
    rows = book.observations
    zeniths = rows.types == ZEN.code
    ends = np.stack([rows.stations, rows.from_points, rows.to_points])
    off = set(map(tuple, ends[:, zeniths & ~rows.active].T.tolist()))
    found = np.zeros(len(rows), np.bool_)
    for row in np.flatnonzero(zeniths & rows.active).tolist():
        found[row] = tuple(ends[:, row].tolist()) in off
    return found


class _Sights:
    """Sights at the first values of their points."""

    def __init__(self, network: Network) -> None:
        self._rows = network.book.observations
        initial = network.fieldwork.initial_values()
        self._xyz = np.where(np.isfinite(initial.coordinates), initial.coordinates, np.nan)
        self._network = network

    def _between(self, rows: IntArray, targets: Numbers) -> tuple[FloatArray, FloatArray]:
        """(n, 3) sights of rows to points, and (n, 3) upwards, at the points where instruments stand."""
        found, frame = self._rows, self._network.frame
        origins = found.from_points[rows]
        up = np.zeros((len(rows), 3))
        up[:, 2] = 1.0
        if not frame.is_plane:
            placed = np.isfinite(self._xyz[origins]).all(axis=1)
            up[placed] = frame.system.vertical_rotation(self._xyz[origins[placed]])[:, 2]
        sights = self._xyz[targets] - self._xyz[origins]
        lift = found.to_heights[rows] - found.from_heights[rows]
        return sights + lift[:, None] * up, up

    def lengths(self, kind: ObservationKind, rows: IntArray) -> FloatArray:
        """(n,) distances, horizontal ones where these were measured."""
        sights, up = self._between(rows, self._rows.to_points[rows])
        if kind is DIST_HZ:
            sights = sights - np.einsum("ij,ij->i", sights, up)[:, None] * up
        return np.asarray(np.linalg.norm(sights, axis=1))

    def variances(self, kind: ObservationKind, rows: IntArray, given: Sigmas) -> FloatArray:
        """(n,) what centring adds to the variances of observations of a kind; NaN without places."""
        instrument, target, vertical = (given.get(name, 0.0) ** 2 for name in CENTRING)
        sights, up = self._between(rows, self._rows.to_points[rows])
        rise = np.einsum("ij,ij->i", sights, up)
        level = sights - rise[:, None] * up
        flat = np.maximum(np.linalg.norm(level, axis=1), SHORTEST)
        slope = np.maximum(np.linalg.norm(sights, axis=1), SHORTEST)
        plan = instrument + target
        if kind in (HZ, AZIM):
            return np.asarray(plan / flat**2)
        if kind is DIST_HZ:
            return np.where(np.isfinite(flat), plan, np.nan)
        if kind is DIST:
            return np.asarray((flat**2 * plan + rise**2 * 2.0 * vertical) / slope**2)
        if kind is ZEN:
            return np.asarray((rise**2 * plan + flat**2 * 2.0 * vertical) / slope**4)
        if kind is ANGLE:
            back, _ = self._between(rows, self._rows.backsights[rows])
            back = back - np.einsum("ij,ij->i", back, up)[:, None] * up
            own = level / flat[:, None] ** 2
            other = back / np.maximum(np.linalg.norm(back, axis=1), SHORTEST)[:, None] ** 2
            ends = np.sum(own**2, axis=1) + np.sum(other**2, axis=1)
            return np.asarray(target * ends + instrument * np.sum((own - other) ** 2, axis=1))
        return np.zeros(len(rows))


def _shares(
    book: FieldBook,
    parts: Sequence[tuple[Sigmas, ObservationKind, IntArray]],
    sigmas: FloatArray,
    relative: FloatArray,
) -> str:
    """What each instrument got, in words."""
    said = []
    for _, kind, rows in parts:
        group = int(book.observations.groups[rows[0]])
        of = f" of {book.groups[group].name}" if group >= 0 else ""
        more = f" + {relative[rows[0]] * 1e6:g} ppm" if relative[rows[0]] else ""
        said.append(f"{_told(kind, sigmas[rows])}{more}{of}")
    return f": {'; '.join(said)}" if said else ""


def _told(kind: ObservationKind, sigmas: FloatArray) -> str:
    """How large standard deviations are, in words."""
    unit, factor = ("cc", 2e6 / np.pi) if kind.is_angle else ("mm", 1e3)
    low, high = (f"{value * factor:.3g}" for value in (sigmas.min(), sigmas.max()))
    size = low if low == high else f"{low} to {high}"
    return f"{kind.words} {size} {unit} ({len(sigmas)})"


def stochastic_model(path: str | Path | None, instrument: str | None) -> StochasticModel:
    """The model of a file, and of an instrument that all others are alike.

    Args:
        path: The file (see `read_stochastic`); None for none.
        instrument: Name of an instrument of the file, or of the library (`data/instruments.toml`): what it is
            worth counts for all observations of instruments that the file does not name. None for none.

    Raises:
        InputError: The file is wrong, or nobody knows the instrument; those that are known are listed.
    """
    model = StochasticModel() if path is None else read_stochastic(path)
    if instrument is None:
        return model
    known = {**read_stochastic(LIBRARY).instruments, **model.instruments}
    if instrument not in known:
        raise InputError(f"--instrument {instrument}: it is none of {', '.join(known)}")
    return replace(model, default={**model.default, **known[instrument]})


def read_stochastic(path: str | Path) -> StochasticModel:
    """The model of a file in TOML: values by name, and a table for each instrument.

    `direction = "3sec"`, `distance = "2mm + 2ppm"`, `instrument-centring = "1mm"`, ... are of all, and those
    after `[instrument.NAME]` of that instrument.

    Raises:
        InputError: The file is no TOML, or a name or a value is not known; it is named.
    """
    import tomllib

    text = "\n".join(read_text(path).lines)
    try:
        given = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: no TOML: {error}") from None
    instruments = given.pop("instrument", {})
    if not isinstance(instruments, dict):
        raise InputError(f"{path}: [instrument.NAME] begins what is of one instrument")
    tables = {str(name): _sigmas(f"{path}: instrument {name}", table) for name, table in instruments.items()}
    return StochasticModel(_sigmas(str(path), given), tables)


def _sigmas(where: str, table: object) -> Sigmas:
    if not isinstance(table, dict):
        raise InputError(f'{where}: names and values are expected, such as direction = "3sec"')
    found: dict[str, float] = {}
    for name, value in table.items():
        if name not in (*NAMES, *SHEETS) or not isinstance(value, str):
            known = ", ".join((*NAMES, *SHEETS))
            raise InputError(f'{where}: {name!r} is none of {known} with a text such as "3sec"')
        if name in SHEETS:
            of_sheet = quantity(where, next(iter(SHEETS[name])), value.strip())
            found = {part: factor * of_sheet for part, factor in SHEETS[name].items()} | found
            continue
        first, _, more = value.partition("+")
        found[name] = quantity(where, name, first.strip())
        if more:
            found["distance-ppm"] = quantity(where, f"{name}-ppm", more.strip())
    return found

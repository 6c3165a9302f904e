"""Points of a project as those of a survey network, and the network that they make with observations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.linalg import block_diag

from obseq import crs
from obseq.errors import InputError
from obseq.images import ControlPoints
from obseq.images.names import unique_names
from obseq.project.layout import ProjectTree
from obseq.project.metadata import whole_match
from obseq.project.options.bundle_options import BundleOptions, Set3D
from obseq.project.points import (
    NO_SYSTEM,
    points_text,
    read_control_points,
    read_entries,
    read_system,
    system_text,
)
from obseq.project.tree import Tree
from obseq.survey import Adjustment, FieldBook, Network, Points, join, make_points
from obseq.survey.equations.frame import Frame
from obseq.survey.model import CoordinateCovariance

ADJUSTED = "MesGCP-NewGCP"


def survey_points(control: ControlPoints) -> Points:
    """Control points as points of a survey network: free, held, with sigmas or with their covariances."""
    known = np.isfinite(control.covariances).all(axis=(1, 2))
    sigmas = np.where(np.isinf(control.sigmas), np.nan, control.sigmas)
    points = make_points(control.names, control.coordinates, sigmas)
    off = control.covariances.copy()
    off[:, range(3), range(3)] = 0.0
    rows = np.flatnonzero(known & (np.abs(np.where(np.isfinite(off), off, 0.0)) > 0.0).any(axis=(1, 2)))
    if not rows.size:
        return points
    names = tuple((control.names[row], component) for row in rows for component in range(3))
    return replace(points, covariance=CoordinateCovariance(names, block_diag(*control.covariances[rows])))


def network_of(
    points: Points, book: FieldBook, definition: str, refraction: float | None = None, weight: float = 1.0
) -> Network:
    """The network of points and observations in the system of a project.

    Args:
        points: in that system.
        book: observations; the points that they name and `points` lacks are free.
        definition: of the system; `LocalNONE` is a plane with heights.
        refraction: coefficient of zenith angles; None for the usual one.
        weight: factor of the weights of all observations.

    Raises:
        InputError: the system is no frame to compute in.
    """
    system = crs.parse("Local" if definition == NO_SYSTEM else definition)
    if not system.is_complete or system.kind is crs.Kind.PROJ:
        raise InputError(
            f"the points are in {definition}, which is no Euclidean frame: convert them first, with "
            "`obseq change-sysco RTL*X0*Y0*Z0*DEFINITION POINTS OUT` (X0 Y0 Z0 near the points)"
        )
    completed, numbered = join(points, _weighted(book, weight))
    frame = Frame(system) if refraction is None else Frame(system, refraction)
    return Network(completed, numbered, frame, system)


def _weighted(book: FieldBook, weight: float) -> FieldBook:
    """The observations with their weights multiplied."""
    rows, root = book.observations, float(np.sqrt(weight))
    scaled = replace(rows, sigmas=rows.sigmas / root, relative_sigmas=rows.relative_sigmas / root)
    clusters = tuple(replace(one, covariance=one.covariance / weight) for one in book.clusters)
    return book if weight == 1.0 else replace(book, observations=scaled, clusters=clusters)


def adjusted_control(adjustment: Adjustment) -> ControlPoints:
    """The adjusted points, with their covariances."""
    found = adjustment.points
    return ControlPoints(found.names, found.coordinates, found.covariances)


def control_of(tree: ProjectTree, options: BundleOptions) -> tuple[ControlPoints, str]:
    """The 3D points of all sets of the options, with their sigmas scaled, and the system of the sets.

    A point that is copied into several sets is one point.

    Raises:
        InputError: a name is in two sets with other coordinates, or the sets are in different systems.
    """
    sets = _without_copies([_chosen(tree, options, part) for part in options.points])
    systems = [read_system(tree.points(part.folder)) for part in options.points]
    if len(set(systems)) > 1:
        folders = ", ".join(f"{p.folder}: {s}" for p, s in zip(options.points, systems, strict=True))
        raise InputError(f"the 3D points are in different systems ({folders}): convert them (change-sysco)")
    names = [name for points in sets for name in points.names]
    whole = ControlPoints(
        unique_names(names, "3D point"),
        np.concatenate([np.zeros((0, 3)), *(points.coordinates for points in sets)]),
        np.concatenate([np.zeros((0, 3, 3)), *(points.covariances for points in sets)]),
    )
    return whole, systems[0] if systems else NO_SYSTEM


def _without_copies(sets: list[ControlPoints]) -> list[ControlPoints]:
    """The sets without the points that an earlier one has with the same coordinates and covariances."""
    kept: list[ControlPoints] = []
    seen: dict[str, tuple[bytes, bytes]] = {}
    for points in sets:
        given = zip(points.coordinates, points.covariances, strict=True)
        told = {name: (a.tobytes(), b.tobytes()) for name, (a, b) in zip(points.names, given, strict=True)}
        kept.append(points.select([name for name in points.names if seen.get(name) != told[name]]))
        seen |= told
    return kept


def _chosen(tree: ProjectTree, options: BundleOptions, part: Set3D) -> ControlPoints:
    """A set of points, without those that the filters leave out."""

    def is_chosen(name: str, information: str) -> bool:
        pairs = ((options.chosen_names, name), (options.chosen_information, information))
        return all(not pattern or whole_match(pattern, word, "GCPFilter") for pattern, word in pairs)

    found = read_control_points(tree.points(part.folder), is_chosen=is_chosen)
    return found.scaled(abs(part.factor))


def adjusted_sets(
    tree: ProjectTree,
    options: BundleOptions,
    adjusted: ControlPoints,
    definition: str,
    *,
    as_json: bool = False,
) -> dict[Path, str | bytes]:
    """The files of the sets of points that are to be written: one per folder, with the points of its sets.

    Points that are in no set go to the first folder.
    """
    members: dict[str, dict[str, Tree]] = {}
    known: set[str] = set()
    for part in options.points:
        entries = read_entries(tree.points(part.folder))
        known |= set(entries)
        if part.out:
            members.setdefault(part.out, {}).update(entries)
    files: dict[Path, str | bytes] = {}
    ending = ".json" if as_json else ".xml"
    for number, (out, mine) in enumerate(members.items()):
        wanted = [name for name in adjusted.names if name in mine or (number == 0 and name not in known)]
        folder = tree.folder("ObjCoordWorld", out)
        files[folder / f"{ADJUSTED}{ending}"] = points_text(
            adjusted.select(wanted), out, mine, as_json=as_json
        )
        files[folder / f"CurSysCo{ending}"] = system_text(definition, as_json=as_json)
    return files

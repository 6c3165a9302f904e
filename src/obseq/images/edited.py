"""A block in the words of networks: copies without some measures or with other sigmas, and its adjustment."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial
from itertools import chain
from pathlib import PurePath
from typing import Self

import numpy as np

from obseq.arguments import FUNCTION, NOTHING, NUMBER, TEXT, TEXTS, WHOLE, expecting, instance, weights_factor
from obseq.arrays import BoolArray, IntArray
from obseq.boundary import Boundary
from obseq.dataclass import dataclass
from obseq.errors import InputError, nearest
from obseq.images.adjusted import AdjustedBlock
from obseq.images.adjustment.adjustable import AdjustableBlock
from obseq.images.adjustment.solution import BundleSolution
from obseq.images.diagnosing.diagnosis import diagnosed, silent
from obseq.images.diagnosing.refusals import explained
from obseq.images.parts import MeasureSet
from obseq.leastsquares import Blocks
from obseq.leastsquares.problem.losses import named_loss
from obseq.reading.origin import Origin

ARROWS = ("->", "\u2192")
KINDS = ("image", "control")
"""Image points, and known coordinates of control points."""
FREE = np.diag([np.inf] * 3)
"""Covariance of a point of which nothing is known."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """What a person means.

    Attributes:
        measures: (n,) rows of each set of image points.
        control: (m,) control points.
    """

    measures: tuple[BoolArray, ...]
    control: BoolArray

    def any(self) -> bool:
        """Whether it is anything."""
        return bool(self.control.any()) or any(rows.any() for rows in self.measures)


class EditedBlock(AdjustableBlock):
    """A block of which copies are made, and which is adjusted with all that belongs to it."""

    def without(self, *what: str, kind: str | None = None) -> Self:
        """The block in which some observations take no part; control points become unknown.

        Args:
            *what: Each one a ray "IMG_1 -> P5", an image "IMG_1" or a point "P5" (all that name it), or a
                place "measures.csv:185".
            kind: "image" for image points only, "control" for known coordinates only.

        Raises:
            InputError: No observation is called so.
        """
        chosen, made = self._chosen(what, kind), self.copied()
        made.sets = [part.of_rows(~out) for part, out in zip(made.sets, chosen.measures, strict=True)]
        made.control = replace(
            made.control, covariances=np.where(chosen.control[:, None, None], FREE, made.control.covariances)
        )
        return made

    def freed(self) -> Self:
        """The block without what is known of the world, control points and positions; its notes say so."""
        made, known = self.copied(), int((~self.control.is_free).any(axis=1).sum())
        what = [f"known coordinates of {known} points"] * bool(known)
        what += ["positions of images"] * bool(self.antennas)
        made.control = replace(
            made.control, covariances=np.array([FREE] * len(made.control.names)).reshape(-1, 3, 3)
        )
        made.antennas.clear()
        if what:
            made.notes.append(f"{' and '.join(what)} take no part: the block is free, as its datum asks")
        return made

    @expecting(kind=TEXT | NOTHING, factor=NUMBER | NOTHING, sigma=NUMBER | NOTHING)
    def weights(
        self, *what: str, kind: str | None = None, factor: float | None = None, sigma: float | None = None
    ) -> Self:
        """The block in which some observations have other sigmas.

        Args:
            *what: As in `without`; none for all.
            kind: As in `without`.
            factor: What multiplies their sigmas.
            sigma: Their sigma in place of what they have: pixels; the unit of the world for control points.

        Raises:
            InputError: No observation is called so; no factor and no sigma, or both; one of no size.
        """
        factor = weights_factor(factor, sigma)
        chosen, made = self._chosen(what, kind), self.copied()
        for k, (part, rows) in enumerate(zip(made.sets, chosen.measures, strict=True)):
            sigmas = part.measures.sigmas.copy()
            sigmas[rows] = factor * sigmas[rows] if sigma is None else sigma
            covariances = part.measures.covariances * (sigmas / part.measures.sigmas).prod(axis=1)
            measures = replace(part.measures, sigmas=sigmas, covariances=covariances)
            made.sets[k] = replace(part, measures=measures)
        known = made.control.covariances.copy()
        known[chosen.control] *= factor**2
        if sigma is not None:
            known[chosen.control] = np.where(np.isinf(known[chosen.control]), np.inf, sigma**2 * np.eye(3))
        made.control = replace(made.control, covariances=known)
        return made

    @expecting(
        max_iterations=WHOLE | NOTHING,
        tolerance=NUMBER | NOTHING,
        progress=FUNCTION | NOTHING,
        datum=TEXT | TEXTS,
        strategy=TEXT,
        loss=TEXT | NOTHING,
        threads=WHOLE,
        blocks=instance(Blocks) | NOTHING,
    )
    def adjust(
        self,
        max_iterations: int | None = None,
        tolerance: float | None = None,
        progress: Callable[[str], None] | None = None,
        *,
        datum: str | Sequence[str] = "control",
        strategy: str = "levenberg-marquardt",
        loss: str | None = None,
        threads: int = 1,
        blocks: Blocks | None = None,
    ) -> AdjustedBlock:
        """Adjusts the block, which does not change: places images, solves the block, looks for errors.

        Args:
            max_iterations: As for `solve`.
            tolerance: As for `solve`.
            progress: Receives what is being done.
            datum: As for `solve`.
            strategy: As for `solve`.
            loss: "huber", "l1", "cauchy" or "tukey" for robust weights of image points.
            threads: How many share the work.
            blocks: As for `solve`.

        Raises:
            InputError: Something in the block makes the adjustment impossible; it is named.
            SingularSystemError: Measures do not determine some unknowns, which are named.
        """
        told, made = progress or silent, self.copied()
        given = made.poses
        limits = {"max_iterations": max_iterations, "tolerance": tolerance}
        options = {"datum": datum, "strategy": strategy, "threads": threads, "blocks": blocks, **limits}
        with explained(made, told, **options):
            told("first values")
            made.initialise()
            solution = made._robustly(loss, options, told)
        boundary = Boundary()
        search = partial(diagnosed, solution, given, told, **options)
        diagnosis = boundary.attempt("the search for errors", search, None, ends=True)
        found = {entry.name: getattr(solution, entry.name) for entry in fields(solution)}
        return AdjustedBlock(**found, diagnosis=diagnosis, failures=tuple(boundary.failures))

    def _robustly(
        self, loss: str | None, options: Mapping[str, object], told: Callable[[str], None]
    ) -> BundleSolution:
        """The solution; what gives no weight at all begins where most fits."""
        made, tell = self, lambda step: told(str(step))
        if loss is None:
            return made.solve(progress=tell, **options)
        for step in dict.fromkeys(("huber", loss)):
            made.sets = [replace(part, robust=named_loss(step)) for part in made.sets]
            solution = made.solve(progress=tell, **options)
            made = made._starting_at(solution)
        return solution

    def _starting_at(self, solution: BundleSolution) -> Self:
        """The block that starts where a solution of it ended; what is known of parameters stays as it was."""
        made = self.copied()
        made.parameter_priors = [
            (re.escape(name), re.escape(camera.name), present if value is None else value, sigma)
            for parameters, cameras, value, sigma in self.parameter_priors
            for camera in self.cameras.values()
            if re.fullmatch(cameras, camera.name)
            for name, present in zip(camera.parameter_names, camera.parameters.tolist(), strict=True)
            if re.fullmatch(parameters, name)
        ]
        made.cameras |= solution.cameras
        others = [name for name in made.poses.images if name not in solution.poses.images]
        made.poses = made.poses.select(others)
        made.add_poses(solution.poses)
        made.add_approximations(solution.points, solution.coordinates)
        return made

    def _control_named(self, name: str) -> BoolArray:
        """(n,) control points that a name, or the place of one, means."""
        meant = {name}
        for names, origin in self.control_origins:
            if line := _line_of(name, origin):
                meant |= {known for known, at in zip(names, origin.lines, strict=True) if at == line}
        return np.array([known in meant for known in self.control.names], np.bool_)

    def _chosen(self, what: tuple[str, ...], kind: str | None) -> Chosen:
        if kind is not None and kind not in KINDS:
            raise InputError(f"no observation is of kind {kind}; there are {', '.join(KINDS)}")
        every = [
            Chosen(
                tuple(_named(part, name) & (kind != "control") for part in self.sets),
                self._control_named(name) & (kind != "image"),
            )
            for name in what
        ]
        for name, found in zip(what, every, strict=True):
            if not found.any():
                points = (part.measures.point_names for part in self.sets)
                known = {*self.camera_of, *self.control.names, *chain(*points)}
                word = "" if kind is None else f" of kind {kind}"
                raise InputError(f"no observation{word} is called {nearest(name, known)}")
        if what:
            columns = zip(*(found.measures for found in every), strict=True)
            measures = tuple(np.logical_or.reduce(rows) for rows in columns)
            return Chosen(measures, np.logical_or.reduce([found.control for found in every]))
        of_images = tuple(np.full(len(part.measures), kind != "control") for part in self.sets)
        return Chosen(of_images, np.full(len(self.control.names), kind != "image"))


def _named(part: MeasureSet, name: str) -> BoolArray:
    """(n,) rows of a set that a name means."""
    given, origin = part.measures, part.origin
    for arrow in ARROWS:
        if arrow in name:
            image, point = (word.strip() for word in name.split(arrow, 1))
            rows = _of(given.image_names, given.image, image) & _of(given.point_names, given.point, point)
            return np.asarray(rows)
    if origin is not None and (line := _line_of(name, origin)):
        return np.asarray(np.equal(origin.lines, line))
    return _of(given.image_names, given.image, name) | _of(given.point_names, given.point, name)


def _line_of(name: str, origin: Origin) -> int:
    """The line of a file that a place `file:line` means, from 1; 0 for none of it."""
    file, _, line = name.rpartition(":")
    is_there = line.isdecimal() and file in (origin.path, PurePath(origin.path).name)
    return int(line) if is_there else 0


def _of(names: Sequence[str], numbers: IntArray, name: str) -> BoolArray:
    """(n,) rows whose number is that of a name."""
    return np.asarray(numbers == (names.index(name) if name in names else -1))

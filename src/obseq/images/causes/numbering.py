"""Which observation of a block each of its equations is of."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from obseq.arrays import BoolArray, IntArray
from obseq.images.adjustment.equations import Equations
from obseq.images.adjustment.surveys import JoinedSurvey
from obseq.images.causes.survey_equations import SurveyEquations
from obseq.images.names import are_among, numbered
from obseq.leastsquares import Batch
from obseq.leastsquares.problem.priors import Prior


class Other(NamedTuple):
    """Equations that are of neither image points nor control points.

    Attributes:
        source: their batch or prior.
        first: number of the first of them.
        rows: observations.
        width: equations of each.
    """

    source: Batch | Prior
    first: int
    rows: int
    width: int


class Parameter(NamedTuple):
    """A parameter of a camera that keeps its value.

    Attributes:
        camera: its name.
        name: of the parameter.
        block: of unknowns.
    """

    camera: str
    name: str
    block: int


class Numbering:
    """The equations of a block in one order: image points, control points, all others, priors.

    Attributes:
        equations: of the block.
        surveys: networks that share its points.
        of_surveys: which observation of these an equation is.
        batches: in that order.
        priors: after them.
        image: (m,) image of each image point, a position in the poses of the start.
        point: (m,) its point.
        part: (m,) its set.
        row: (m,) its row there.
        kept: (m,) whether it takes part.
        control: (k, 2) point and component of each equation of a control point.
        held: (h, 2) the same of coordinates that keep their values, and that image points alone observe.
        others: the rest.
        parameters: of cameras that are held.
        n: how many equations there are.
    """

    def __init__(self, equations: Equations, surveys: Sequence[JoinedSurvey] = ()) -> None:
        self.equations, self.surveys = equations, tuple(surveys)
        self.of_surveys = SurveyEquations(self.surveys)
        measures = equations.measures
        sets, none = equations.start.sets, np.zeros(0, np.int64)
        batch, self.control = equations.control
        own = [item.batch for item in measures] + ([] if batch is None else [batch])
        known = set(map(id, own))
        rest = [other for other in equations.system.batches if id(other) not in known]
        self.batches, self.priors = [*own, *rest], list(equations.system.priors)
        self.image: IntArray = np.concatenate(
            [none, *(sets[item.part].image[item.rows] for item in measures)]
        )
        self.point = np.concatenate([none, *(sets[item.part].point[item.rows] for item in measures)])
        self.part = np.concatenate([none, *(np.full(len(item.rows), item.part) for item in measures)])
        self.row = np.concatenate([none, *(item.rows for item in measures)])
        self.kept: BoolArray = np.concatenate(
            [np.zeros(0, np.bool_), *(item.batch.active for item in measures)]
        )
        self.first_control = 2 * len(self.image)
        self.others: list[Other] = []
        self.n = self.first_control + len(self.control)
        for other in rest:
            self._add(Other(other, self.n, other.n, other.shape.n_residuals))
        for prior in self.priors:
            self._add(Other(prior, self.n, len(prior.scalars), 1))
        self.parameters = self._held()
        self.held = self._held_coordinates()

    def _add(self, other: Other) -> None:
        self.others.append(other)
        self.n += other.rows * other.width

    def _held(self) -> list[Parameter]:
        """Parameters of cameras that keep the values that were given."""
        table, found = self.equations.system.unknowns, []
        for camera, block in zip(self.equations.cameras, self.equations.calibrations.tolist(), strict=True):
            is_held = table.frozen[table.scalars([block])].ravel().tolist()
            named = zip(table.components(block), is_held, strict=True)
            found += [Parameter(camera, name, block) for name, held in named if held]
        return found

    def _held_coordinates(self) -> IntArray:
        start = self.equations.start
        own = start.is_control & ~np.array(are_among(start.points, self.equations.block.joined_points))
        own &= np.bincount(self.point[self.kept], minlength=len(start.points)) > 0
        return np.argwhere(own[:, None] & start.is_held)

    @property
    def coordinates(self) -> IntArray:
        """(k + h, 2) point and component of all known coordinates: those with an equation, then held ones."""
        return np.concatenate([self.control.reshape(-1, 2), self.held])

    @property
    def coordinate_columns(self) -> IntArray:
        """(k + h,) the columns of their errors."""
        held = self.n + len(self.parameters) + np.arange(len(self.held))
        return np.concatenate([self.first_control + np.arange(len(self.control)), held])

    @property
    def camera(self) -> IntArray:
        """(i,) number of the camera of each image, a position in `cameras`."""
        return numbered([camera.name for camera in self.equations.start.cameras])[1]

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras."""
        return tuple(numbered([camera.name for camera in self.equations.start.cameras])[0])

    def label(self, measure: int) -> tuple[str, str]:
        """Image and point of an image point."""
        start = self.equations.start
        return start.poses.images[self.image[measure]], start.points[self.point[measure]]

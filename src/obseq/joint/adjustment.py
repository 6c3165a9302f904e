"""The open adjustment: survey networks, blocks of images and unknowns of one's own, joined by any formula."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from obseq.errors import InputError
from obseq.images.adjustment.equations import Equations
from obseq.images.adjustment.start import start_of
from obseq.images.adjustment.surveys import follower, join_surveys, places_in, with_surveys
from obseq.images.names import as_names
from obseq.joint.adjusted import JointSolution
from obseq.joint.named import add_named, named_equation
from obseq.joint.places import place_points
from obseq.joint.solution import ImagePart
from obseq.leastsquares import LeastSquares
from obseq.leastsquares.problem.arguments import finite
from obseq.survey.points import make_points

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import ArrayLike

    from obseq.arrays import FloatArray
    from obseq.images import BundleAdjustment
    from obseq.joint.named import NamedEquation
    from obseq.kernels.loading import Kernel
    from obseq.leastsquares import Batch, Blocks, Iteration, Loss
    from obseq.leastsquares.iterations.strategies import Strategy
    from obseq.leastsquares.problem.priors import Prior
    from obseq.survey import InitialValues, Network
    from obseq.survey.points import Points

GROUP = "known values"


class Adjustment:
    """An adjustment of everything that has a name, by any formula.

    What a name stands for follows from what a formula wants: for a point, a point or the projection centre
    of an image; for a rotation, that of an image, of a pose or of the station on a point; for a vector, one
    that was added, or the calibration of an image or a camera; for a direction, that of a clinometer too.
    Points of one name are one point. Metres and radians.

    Example:
        >>> import obseq
        >>> site = obseq.Adjustment()
        >>> site.add_points(["A", "B", "C"], [[0, 0, 0], [9, 0, 0], [0, 9, 0]], 0.0)
        >>> site.add_points(["P"], [[2, 2, 1]])
        >>> ends = {"p1": "P", "p2": ["A", "B", "C"]}
        >>> number = site.add("Dist3D", **ends, distance=[3.0, 54**0.5, 54**0.5], sigma=0.001)
        >>> site.solve().points(["P"]).round(3).tolist()
        [[2.0, 2.0, 1.0]]
    """

    def __init__(self) -> None:
        self._block: BundleAdjustment | None = None
        self._networks: list[Network] = []
        self._points: dict[str, FloatArray] = {}
        self._own: dict[str, dict[str, FloatArray]] = {
            kind: {} for kind in ("Point2", "Rotation", "Direction", "Vector", "Scalar")
        }
        self._known: list[tuple[str, str, FloatArray, FloatArray]] = []
        self._held: list[tuple[str, str]] = []
        self._equations: list[NamedEquation] = []

    @classmethod
    def of(cls, *parts: Network | BundleAdjustment) -> Adjustment:
        """Survey networks and a block of images, opened: anything may be added, they stay as they are."""
        from obseq.survey import Network

        opened = cls()
        for part in parts:
            if isinstance(part, Network):
                opened.add_survey(part)
            else:
                opened.add_images(part)
        return opened

    # What there is

    def add_images(self, block: BundleAdjustment) -> None:
        """Takes in a block of images with all that it holds: control points, rigs, clinometers, surveys.

        Raises:
            InputError: There is one already; several blocks are one `BundleAdjustment`.
        """
        if self._block is not None:
            raise InputError("there is a block of images already: put all images in one BundleAdjustment")
        self._block = block

    def add_survey(self, network: Network) -> None:
        """Takes in a survey network: its known points, stations and observations."""
        self._networks.append(network)

    def add_points(
        self,
        names: Sequence[str],
        coordinates: ArrayLike | None = None,
        sigmas: ArrayLike | None = None,
    ) -> None:
        """Adds points, or says of points of a network or block what else is known of them.

        Args:
            names: (n,) of the points.
            coordinates: (n, 3), metres; None for points that equations place.
            sigmas: None for free points, which start there; 0 for points that are held; else their standard
                deviations, one, (3,) or (n, 3), metres.
        """
        names = as_names(names, "points: point")
        places = np.full((len(names), 3), np.nan)
        if coordinates is not None:
            places = finite(coordinates, (len(names), 3), "points: coordinates")
        self._points |= dict(zip(names, places, strict=True))
        if sigmas is not None:
            self._say("Point3", names, places, sigmas)

    def add_unknowns(
        self, names: Sequence[str] | str, values: ArrayLike, sigmas: ArrayLike | None = None
    ) -> None:
        """Adds numbers, values (n,), or vectors, values (n, k), and what is known of them, as for points."""
        names = as_names([names] if isinstance(names, str) else names, "unknowns: name")
        array = np.atleast_1d(np.asarray(values, dtype=np.float64))
        array = array[:, None] if array.ndim == 1 and len(array) == len(names) else np.atleast_2d(array)
        if len(array) != len(names) or not np.isfinite(array).all():
            raise InputError(f"unknowns {', '.join(names)}: one finite value, or row of values, for each")
        kind = "Scalar" if array.shape[1] == 1 else "Vector"
        self._own[kind] |= dict(zip(names, array, strict=True))
        if sigmas is not None:
            self._say(kind, names, array, sigmas)

    def add_plane_points(self, names: Sequence[str], coordinates: ArrayLike) -> None:
        """Adds points of a plane, (n, 2): of an image, or on a section of a line."""
        names = as_names(names, "plane points: point")
        array = finite(coordinates, (len(names), 2), "plane points: coordinates")
        self._own["Point2"] |= dict(zip(names, array, strict=True))

    def add_poses(self, names: Sequence[str], centres: ArrayLike, rotations: ArrayLike) -> None:
        """Adds poses, of scanners for instance: centres (n, 3), rotations (n, 3, 3) to the world."""
        self.add_points(names, centres)
        self.add_rotations(names, rotations)

    def add_rotations(self, names: Sequence[str], rotations: ArrayLike) -> None:
        """Adds rotations (n, 3, 3) from local frames to the world."""
        names = as_names(names, "rotations: name")
        array = finite(rotations, (len(names), 3, 3), "rotations")
        self._own["Rotation"] |= dict(zip(names, array, strict=True))

    def add_directions(self, names: Sequence[str], vectors: ArrayLike) -> None:
        """Adds unit directions, from vectors (n, 3) of any length."""
        names = as_names(names, "directions: name")
        array = finite(vectors, (len(names), 3), "directions")
        self._own["Direction"] |= dict(zip(names, array, strict=True))

    def hold(self, names: Sequence[str] | str, kind: str) -> None:
        """Keeps what is there: names of a kind (Point3, Rotation, Direction, Vector, Scalar)."""
        named = [names] if isinstance(names, str) else names
        self._held += [(kind, name) for name in as_names(named, "hold: name")]

    def _say(self, kind: str, names: Sequence[str], values: FloatArray, sigmas: ArrayLike) -> None:
        given = np.broadcast_to(np.asarray(sigmas, dtype=np.float64), values.shape)
        if not (given >= 0.0).all() or not np.isfinite(values).all():
            raise InputError(f"{', '.join(names[:3])}: sigmas of given values must not be negative")
        for name, value, sigma in zip(names, values, given, strict=True):
            if (sigma == 0.0).all():
                self._held.append((kind, name))
            else:
                self._known.append((kind, name, value, np.where(sigma == 0.0, 1e-9, sigma)))

    # What was observed

    def add(
        self,
        formula: str | Kernel,
        *,
        sigma: ArrayLike,
        group: str | None = None,
        loss: Loss | str | None = None,
        **named: object,
    ) -> int:
        """Adds observations of a formula of the catalogue, or of one's own, by the names of its arguments.

        Args:
            formula: its name (`obseq formulas` lists them), or a compiled formula.
            sigma: one, (n,) or (n, n_residuals), in the unit of the residuals.
            group: under which sums of squares are kept; the formula's name when None.
            loss: robust weights, such as "huber".
            **named: each argument: names of what is unknown, numbers of what is given; of one or of n
                observations. A station, camera or scan is one name.

        Returns:
            The number of the equation, for `JointSolution.residuals`.

        Raises:
            InputError: An argument is missing, unknown or of another kind.
        """
        self._equations.append(named_equation(formula, named, sigma, group, loss))
        return len(self._equations) - 1

    # Solution

    def solve(
        self,
        max_iterations: int = 50,
        tolerance: float = 1e-6,
        covariance: bool = True,
        strategy: str | Strategy = "levenberg-marquardt",
        threads: int = 1,
        progress: Callable[[Iteration], None] | None = None,
        blocks: Blocks | None = None,
    ) -> JointSolution:
        """Adjusts everything; this object stays as it is.

        Args:
            max_iterations: the iterations end at this number when they have not converged before.
            tolerance: they end when no unknown moves any more by this share of its standard deviation.
            covariance: False when no precision will be asked for.
            strategy: see `obseq.LeastSquares.solve`.
            threads: how many share the work.
            progress: receives the record of each iteration.
            blocks: how it is solved in blocks, with little memory or by many workers; None for at once.

        Raises:
            InputError: A name is that of nothing, or nothing gives a point its place.
            SingularSystemError: Some unknowns are not determined; they are named.
        """
        system = LeastSquares(blocks or "auto", threads)
        images, networks = self._images(system)
        initial = images[1] if images else [self._placed(network).initial_values() for network in networks]
        part = images[0] if images else None
        shared = list(places_in(part.start, part.equations)) if part else []
        turned = dict(system.unknowns.called("Rotation"))
        surveys = join_surveys(networks, initial, system, shared, turned)
        self._add_own(system)
        also = dict(self._block.camera_of) if self._block else {}
        place_points(system, self._unplaced(system), self._equations, also)
        known, batches = self._join(system, also)
        start = system.unknowns.state()
        result = system.solve(
            max_iterations,
            tolerance,
            covariance or None,
            before_iteration=follower(surveys),
            progress=progress,
            strategy=strategy,
        )
        equations = tuple(zip(self._equations, batches, strict=True))
        priors = tuple(
            (name, prior)
            for (kind, name, *_), prior in zip(self._known, known, strict=True)
            if kind == "Point3"
        )
        return JointSolution(
            system, result, equations, part, tuple(surveys), start, self._own_points(), priors
        )

    def _own_points(self) -> Points:
        """The points that were added, with what is known of them."""
        sigmas = {name: np.full(3, np.nan) for name in self._points}
        sigmas |= {name: sigma for kind, name, _, sigma in self._known if kind == "Point3"}
        sigmas |= {name: np.zeros(3) for kind, name in self._held if kind == "Point3" and name in sigmas}
        names = list(self._points)
        known = np.array([sigmas[name] for name in names]).reshape(-1, 3)
        return make_points(names, np.array([self._points[name] for name in names]).reshape(-1, 3), known)

    def _images(
        self, system: LeastSquares
    ) -> tuple[tuple[ImagePart, list[InitialValues]] | None, list[Network]]:
        """The block in the system with the starts of all networks, and these; None without images."""
        if self._block is None:
            return None, self._networks
        networks = [*self._block.surveys, *map(self._placed, self._networks)]
        start, initial = with_surveys(networks, start_of(self._block))
        return (
            ImagePart(self._block, start, Equations(self._block, start, system, False)),
            initial,
        ), networks

    def _placed(self, network: Network) -> Network:
        """A network whose points without coordinates start where this adjustment says."""
        from dataclasses import replace

        coordinates = network.points.coordinates.copy()
        for row, name in enumerate(network.points.names):
            if name in self._points and not np.isfinite(coordinates[row]).all():
                coordinates[row] = self._points[name]
        return replace(network, points=replace(network.points, coordinates=coordinates))

    def _add_own(self, system: LeastSquares) -> None:
        """The unknowns that no network and no block has; points without a place start at the origin."""
        there = self._places(system)
        new = {name: place for name, place in self._points.items() if name not in there}
        if new:
            system.add_points(list(new), np.nan_to_num(np.array(list(new.values()))))
        adders: Mapping[str, Callable[..., object]] = {
            "Point2": system.add_points,
            "Rotation": system.add_rotations,
            "Direction": system.add_directions,
        }
        for kind, add in adders.items():
            if own := self._own[kind]:
                add(list(own), np.array(list(own.values())))
        for name, value in self._own["Vector"].items():
            system.add_vectors([name], value[None])
        if numbers := self._own["Scalar"]:
            system.add_scalars(list(numbers), np.array([value[0] for value in numbers.values()]))

    def _places(self, system: LeastSquares) -> set[str]:
        """Names of points and projection centres of the system."""
        known = set(system.unknowns.called("Point3"))
        images = set(self._block.camera_of) if self._block else set()
        return known | {image for image in images if f"{image} centre" in known}

    def _unplaced(self, system: LeastSquares) -> list[str]:
        known = system.unknowns.called("Point3")
        return [name for name, at in self._points.items() if name in known and not np.isfinite(at).all()]

    def _join(self, system: LeastSquares, also: Mapping[str, str]) -> tuple[list[Prior], list[Batch]]:
        """What is known, and the equations, in the system."""
        known = [
            system.add_prior(system.ids([name], kind), value[None], sigma[None], GROUP)
            for kind, name, value, sigma in self._known
        ]
        for kind, name in self._held:
            system.freeze(system.ids([name], kind))
        return known, [add_named(system, equation, also) for equation in self._equations]

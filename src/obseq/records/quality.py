"""Parts of the record of an adjustment that say its quality; metres and radians."""

from __future__ import annotations

from obseq.printable import listed
from obseq.records.record import Record

_MOST_LABELS = 4
"""Observations that a sentence names."""


class EllipseRecord(Record, frozen=True):
    """An error ellipse in x and y: semi-axes (m), bearing of the major one (rad, clockwise from y)."""

    semi_major: float
    semi_minor: float
    bearing: float


class EllipsoidRecord(Record, frozen=True):
    """An error ellipsoid.

    Attributes:
        axes: Semi-axes (m), the longest first.
        bearings: Of the axes (rad, clockwise from y).
        elevations: Of the axes above the plane of x and y (rad), from 0 to a right angle.
    """

    axes: tuple[float, ...]
    bearings: tuple[float, ...]
    elevations: tuple[float, ...]


class EffectRecord(Record, frozen=True):
    """What the detectable bias of an observation does to the coordinates, in the computation frame.

    Attributes:
        point: The point that it moves most.
        x: By how much (m), as y and z.
    """

    point: str
    x: float
    y: float
    z: float


class MotionRecord(Record, frozen=True):
    """A motion of points that no observation sees.

    Attributes:
        text: What it is: "the rotation about z", "a change of shape".
        points: The points that move.
        moves: How each of them moves along x, y, z of the frame; the farthest by 1.
    """

    text: str
    points: tuple[str, ...]
    moves: tuple[tuple[float, ...], ...]


class StatisticsRecord(Record, frozen=True):
    """How the active observations of one type, or of one station, fit.

    Attributes:
        name: The type, or the point of the station.
        count: How many there are.
        unused: How many more are not used.
        redundancy: Sum of their redundancy numbers; None where reliability was not asked for.
        rms: Root of the mean squared normalised residual.
        mean: Mean normalised residual.
        largest: Largest standardised residual (normalised without reliability) in absolute value.
        sigma_factor: Root of the weighted sum of squares over the redundancy: what would multiply their
            sigmas; None without redundancy.
        lower: Smallest such factor that is expected of sigmas that are right; None where it is not tested.
        upper: Largest one.
        level: Probability that it lies beyond them where the sigmas are right.
        sense: Of a type, how its residuals lie in the plan: "across" the sight, "along" it, "" for neither.
    """

    name: str
    count: int
    unused: int
    redundancy: float | None
    rms: float | None
    mean: float | None
    largest: float | None
    sigma_factor: float | None
    lower: float | None = None
    upper: float | None = None
    level: float | None = None
    sense: str = ""


class ReliabilityRecord(Record, frozen=True):
    """What stands behind the reliability of single observations.

    Attributes:
        level: Probability that the test of one observation rejects it where nothing is wrong.
        power: Probability that it finds a bias of the detectable size.
        non_centrality: What the two amount to, in standard deviations of a residual.
        critical: Limit of standardised residuals at that level.
        tau_critical: Limit of tau at that level; None with redundancy 1.
        uncontrolled: How many observations nothing controls.
        tests: How many are tested.
    """

    level: float
    power: float
    non_centrality: float
    critical: float
    tau_critical: float | None
    uncontrolled: int
    tests: int


class JointTestRecord(Record, frozen=True):
    """The test of the components of a vector, or of a position, as one observation.

    Attributes:
        what: The vector or position: "vector A -> B", "known position of P".
        file: Of its first component; empty where there is none.
        line: Of its first component.
        rows: Places of its components in `observations`, from 0; none for a known position.
        statistic: T; NaN where nothing controls it.
        degrees: Degrees of freedom of T, the number of components that others control.
        critical: Limit of T, which finds an error with the power that the tests of one observation have.
        level: Probability that T exceeds it where nothing is wrong.
        blunder: Estimates of the errors of its components (m).
        rise: Estimate of an error of the height alone, as of an antenna (m); None where it is not known.
        rise_test: The standardised residual of that.
    """

    what: str
    file: str
    line: int
    rows: tuple[int, ...]
    statistic: float
    degrees: int
    critical: float
    level: float
    blunder: tuple[float, ...]
    rise: float | None = None
    rise_test: float | None = None

    @property
    def name(self) -> str:
        """What it is, and where it was read."""
        return f"{self.what} ({self.file}:{self.line})" if self.file else self.what

    @property
    def is_beyond(self) -> bool:
        """Whether the test fails."""
        return self.statistic > self.critical


class RejectionRecord(Record, frozen=True):
    """An observation that data snooping left out.

    Attributes:
        observation: Its type, points, file and line.
        row: Its place in `observations`, from 0.
        statistic: The w or tau that failed its test.
        p_value: Probability that the largest of all is larger still without any blunder.
        blunder: Estimate of the error of its value, m or rad.
        detectable: Its minimal detectable bias.
        companions: How many other components of its vector were left out with it.
        degrees: Degrees of freedom of its test: above 1 where its components were tested as one vector, and
            the statistic is T.
        critical: Limit of T there; None of others.
        blunders: Estimates of the errors there, its own first (m).
    """

    observation: str
    row: int
    statistic: float
    p_value: float
    blunder: float
    detectable: float | None
    companions: int = 0
    degrees: int = 1
    critical: float | None = None
    blunders: tuple[float, ...] = ()


class SnoopingRecord(Record, frozen=True):
    """What data snooping did.

    Attributes:
        statistic: What was tested: "w" or "tau".
        level: Probability of leaving out anything where nothing is wrong.
        end: Why it ended.
        suspects: Observations that could not be told apart, or without which unknowns are undetermined.
        rejections: What was left out, in the order found.
        most_moved: The point that this moved most.
        moved: By how much (m).
    """

    statistic: str
    level: float
    end: str
    suspects: tuple[str, ...]
    rejections: tuple[RejectionRecord, ...]
    most_moved: str | None = None
    moved: float | None = None


KNOWN = "known "
"""What the name of a known coordinate that is suspected begins with."""


class VarianceComponentRecord(Record, frozen=True, omit_defaults=False):
    """The variance of one kind of observation, as the residuals show it.

    Attributes:
        group: The kind.
        factor: What multiplies the given variances.
        sigma_factor: What multiplies the given sigmas.
        precision: Standard deviation of the factor.
        redundancy: Share of the kind in the redundancy.
        supported: False when the observations do not support it: it is held at the smallest value.
    """

    group: str
    factor: float
    sigma_factor: float
    precision: float | None
    redundancy: float
    supported: bool


class RelativeRecord(Record, frozen=True):
    """The precision of two points relative to each other.

    Attributes:
        first: A point.
        second: Another, which an observation joins with it.
        distance: Between them (m).
        precision: Of the distance (m).
        bearing_precision: Of the bearing (rad); None for a vertical line.
        ellipse: Where the second is, seen from the first.
    """

    first: str
    second: str
    distance: float
    precision: float
    bearing_precision: float | None
    ellipse: EllipseRecord


class GlobalTestRecord(Record, frozen=True):
    """The two-sided chi-square test of the variance factor against 1.

    Attributes:
        sigma0: What is tested: the root of the variance factor, in which residuals of known points count.
        lower: Smallest sigma0 that the test accepts.
        upper: Largest sigma0 that the test accepts.
        level: Probability of rejecting sigmas that are right.
        p_value: Probability of a sigma0 at least as far out if the sigmas are right.
        passed: Whether sigma0 lies between the limits.
    """

    sigma0: float
    lower: float
    upper: float
    level: float
    p_value: float
    passed: bool


class LeftOutRecord(Record, frozen=True, omit_defaults=False):
    """A point or a station that nothing determines, and that was left out with its observations.

    Attributes:
        place: Approximate x, y, z in the computation frame; None where none were given.
        directions: Unit vectors along which its observations let a point move; None where they leave more.
    """

    what: str
    name: str
    reason: str
    observations: tuple[str, ...]
    place: tuple[float, ...] | None = None
    directions: tuple[tuple[float, ...], ...] | None = None

    @property
    def sentence(self) -> str:
        """What is left out, with which observations, and why."""
        shown = listed(self.observations, _MOST_LABELS)
        return f"{self.what} is left out, with its observations ({shown or 'none'}): {self.reason}"


class UnusedRecord(Record, frozen=True):
    """Observations of a file that take no part, and that the file does not switch off itself.

    Attributes:
        reason: Why, such as "point T has neither fix nor adj".
        observations: What they are, with their lines.
    """

    reason: str
    observations: tuple[str, ...]


class DoubtfulRecord(Record, frozen=True):
    """A point that converged, and of which the observations say next to nothing.

    Attributes:
        axis: Its worst coordinate, of x, y and z.
        sigma: Standard deviation of that coordinate, a priori (m).
        sight: Length of its nearest sight (m).
        circle: Points on one circle with it, that its directions go to (danger circle).
    """

    name: str
    axis: str
    sigma: float
    sight: float
    circle: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """What is wrong, and what to do."""
        advice = "do not use it, but observe it more, or hold that coordinate"
        if self.circle:
            advice = (
                f"{', '.join(self.circle)} and {self.name} lie on one circle, nearly (danger circle): "
                "directions to them fit everywhere on it; do not use it, but add a point off the circle, or "
                "a distance"
            )
        return (
            f"point {self.name}: its {self.axis} has a standard deviation of {self.sigma:.4g} m, and its "
            f"nearest sight {self.sight:.4g} m: the observations say next to nothing of it; {advice}"
        )


class ReplacedRecord(Record, frozen=True, omit_defaults=False):
    """Approximate coordinates that observations contradict, and that were not used.

    Attributes:
        place: File and line that give the approximation.
        given: The approximation, in the system of the points.
        used: What the observations give, in the same system.
        moved: Distance between the two (m).
    """

    name: str
    place: str
    given: tuple[float, ...]
    used: tuple[float, ...]
    moved: float

    @property
    def sentence(self) -> str:
        """Which approximation was replaced, by what."""
        given, used = (", ".join(f"{value:.3f}" for value in xyz) for xyz in (self.given, self.used))
        return (
            f"point {self.name} ({self.place}): its approximate coordinates ({given}) are {self.moved:.3g} m "
            f"from where its observations place it; they were replaced by ({used})"
        )

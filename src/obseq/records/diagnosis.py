"""What a diagnosis found, as the result file holds it and reports print it."""

from __future__ import annotations

from obseq.records.record import Record


class PlaceRecord(Record, frozen=True, omit_defaults=False):
    """An observation by where it is written.

    Attributes:
        file: The file.
        line: The line in it, from 1.
        row: Its place in the list of observations of the result.
    """

    file: str
    line: int
    row: int


class KnownRecord(Record, frozen=True, omit_defaults=False):
    """A known coordinate.

    Attributes:
        name: The point.
        coordinate: "x", "y" or "z" of the system of the points.
    """

    name: str
    coordinate: str


class SlipRecord(Record, frozen=True, omit_defaults=False):
    """A slip that may be behind an error.

    Attributes:
        code: Its stable code (`obseq causes CODE`).
        text: In words.
    """

    code: str
    text: str


class SuspectRecord(Record, frozen=True, omit_defaults=False):
    """What may be wrong.

    Attributes:
        code: Stable code of the cause (`obseq causes CODE`).
        what: What it is called: the observation, the point or the group, with file and line.
        observations: Those that it concerns.
        points: The known coordinates that it concerns.
        images: Names of the images that it concerns as a whole.
    """

    code: str
    what: str
    observations: tuple[PlaceRecord, ...] = ()
    points: tuple[KnownRecord, ...] = ()
    images: tuple[str, ...] = ()


class AccusedRecord(SuspectRecord, frozen=True, omit_defaults=False):
    """One error.

    Attributes:
        text: How large it is, what is behind it, and what nothing tells from it, in words.
        size: Estimates of it: given minus right, in `unit`.
        sigma: Their standard deviations.
        unit: "m", "rad", or "" for a ratio.
        test: Statistic T of its test.
        limit: What T must exceed.
        others: What nothing tells from it.
        slips: What may be behind it, the likeliest first.
    """

    text: str = ""
    size: tuple[float, ...] = ()
    sigma: tuple[float, ...] = ()
    unit: str = ""
    test: float = 0.0
    limit: float = 0.0
    others: tuple[SuspectRecord, ...] = ()
    slips: tuple[SlipRecord, ...] = ()


class DiagnosisRecord(Record, frozen=True, omit_defaults=False):
    """What is wrong with an adjustment.

    Attributes:
        status: "accepted": nothing; "explained": by what is accused; "unexplained": something is wrong that
            this does not explain; "undecided": no adjustment was found in which it could be looked for.
        left: Weighted sum of squares without what is accused.
        redundancy: Its degrees of freedom.
        accused: The errors, the clearest first.
        remarks: Effects that many observations show together, none of which they change by a sigma.
        reason: Why it is undecided, or what was not tried; empty for nothing to say.
    """

    status: str
    left: float
    redundancy: int
    accused: tuple[AccusedRecord, ...] = ()
    reason: str = ""
    remarks: tuple[AccusedRecord, ...] = ()

    @property
    def sigma0(self) -> float | None:
        """Unit-weight estimate without what is accused; None without redundancy."""
        return (self.left / self.redundancy) ** 0.5 if self.redundancy > 0 else None

    @property
    def is_silent(self) -> bool:
        """Whether nothing is accused, and that was found out."""
        return not self.accused and self.status != "undecided"

    @property
    def is_quiet(self) -> bool:
        """Whether nothing is wrong: not where something is, if nothing is accused of it."""
        return self.status == "accepted"

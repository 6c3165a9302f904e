"""An open adjustment as people ask it: its solution, and its record, tables, listing and files."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from obseq.dataclass import dataclass
from obseq.joint.record import record_of
from obseq.joint.solution import Solved
from obseq.records.adjustment import AdjustmentRecord
from obseq.records.table import AnyTable
from obseq.report.formats import FORMATS
from obseq.report.saving import save


@dataclass(frozen=True, eq=False)
class JointSolution(Solved):
    """An adjusted whole, with its record."""

    def record(self, title: str | None = None) -> AdjustmentRecord:
        """What the result file holds and the reports print: all points, observations, tests, what is wrong.

        Image points are in the record of their block (`block`).
        """
        return record_of(self, title)

    def table(self, name: str = "points") -> AnyTable:
        """A table of the record: "points", "observations", "constraints", "types", ... (docs/result-file.md).

        Raises:
            InputError: The record has no such list.
        """
        return self.record().table(name)

    def save(self, path: str | Path) -> None:
        """Writes the record: `.json` (read again by `obseq.load`), `.html` or `.txt`, by the suffix.

        Raises:
            InputError: The suffix is another, or the file cannot be written.
        """
        record = self.record()
        save({form.suffix: partial(form.write, record) for form in FORMATS}, path)

    def report(self) -> str:
        """The complete listing, as of networks."""
        from obseq.report.adjusted import outcome
        from obseq.report.summary import listing

        return listing(outcome(self.record()))

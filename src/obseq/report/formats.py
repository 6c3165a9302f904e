"""The formats that results are written in: one entry each, from which the options of the commands follow."""

from collections.abc import Callable
from functools import partial

from obseq.dataclass import dataclass
from obseq.records.adjustment import AdjustmentRecord
from obseq.writing import Content

LARGE = 50_000
"""Observations, or image points, above which a folder of results holds columns in place of JSON and listing.

JSON takes 600 bytes of each and the listing 250: 40 MB together, from which on editors no longer open them at
once, and nobody reads them. Columns take 60.
"""


@dataclass(frozen=True)
class Format:
    """A format of results.

    Attributes:
        name: Of the option that asks for it.
        suffix: What its files end in.
        purpose: What it is, for the help of commands.
        write: What a file holds.
        sizes: Of results that a folder has it of: "all", "small" or "large".
    """

    name: str
    suffix: str
    purpose: str
    write: Callable[[AdjustmentRecord], Content]
    sizes: str = "all"

    def suits(self, size: int) -> bool:
        """Whether a folder has it of a result of so many observations."""
        return self.sizes == "all" or (self.sizes == "large") == (size > LARGE)


def _result_file(record: AdjustmentRecord) -> Content:
    from obseq.report.result_file import write_json

    return partial(write_json, record=record)


def _page(record: AdjustmentRecord) -> str:
    from obseq.report.page import page

    return page(record)


def _listing(record: AdjustmentRecord) -> str:
    from obseq.report.adjusted import outcome
    from obseq.report.summary import listing

    return listing(outcome(record))


def _columns(record: AdjustmentRecord) -> Content:
    from obseq.report.result_columns import write_columns

    return partial(write_columns, record=record)


FORMATS = (
    Format("json", ".json", "every result at full precision, for programs", _result_file, "small"),
    Format("html", ".html", "a page with a plan of the network", _page),
    Format("text", ".txt", "a complete listing", _listing, "small"),
    Format("npz", ".npz", "every result as columns, for programs and large networks", _columns, "large"),
)

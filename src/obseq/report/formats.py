"""The formats that results are written in: one entry each, from which the options of the commands follow."""

from collections.abc import Callable

from obseq.dataclass import dataclass
from obseq.records.adjustment import AdjustmentRecord


@dataclass(frozen=True)
class Format:
    """A format of results.

    Attributes:
        name: Of the option that asks for it.
        suffix: What its files end in.
        purpose: What it is, for the help of commands.
        write: The text of the file.
    """

    name: str
    suffix: str
    purpose: str
    write: Callable[[AdjustmentRecord], str]


def _result_file(record: AdjustmentRecord) -> str:
    from obseq.report.result_file import to_json

    return to_json(record)


def _page(record: AdjustmentRecord) -> str:
    from obseq.report.page import page

    return page(record)


def _listing(record: AdjustmentRecord) -> str:
    from obseq.report.adjusted import outcome
    from obseq.report.summary import listing

    return listing(outcome(record))


FORMATS = (
    Format("json", ".json", "every result at full precision, for programs", _result_file),
    Format("html", ".html", "a page with a plan of the network", _page),
    Format("text", ".txt", "a complete listing", _listing),
)

"""Reports of an adjustment: one-screen summary and the formats of results, all from one record.

The record (`obseq.records.adjustment`) is what the result file holds: none of the reports can say something
else, and `read_json` gives it back to make them again.
"""

from obseq.records.adjustment import AdjustmentRecord
from obseq.report.formats import FORMATS, Format
from obseq.report.listing import listing
from obseq.report.page import page
from obseq.report.result_file import read_json, to_json
from obseq.report.summary import summary

__all__ = [
    "FORMATS",
    "AdjustmentRecord",
    "Format",
    "listing",
    "page",
    "read_json",
    "summary",
    "to_json",
]

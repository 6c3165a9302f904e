"""Reports of an adjustment: one-screen summary, complete listing, JSON and HTML, all from one record.

The record is the dictionary of format "obseq-adjustment", version 1 (`obseq.report.record`): what the result
file holds is what every report is made of, so none of them can say something else.
"""

from obseq.report.listing import listing
from obseq.report.page import page
from obseq.report.record import AdjustmentRecord, to_json
from obseq.report.statistics import Verdict, verdict
from obseq.report.summary import summary

__all__ = ["AdjustmentRecord", "Verdict", "listing", "page", "summary", "to_json", "verdict"]

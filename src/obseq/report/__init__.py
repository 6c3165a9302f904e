"""Reports of an adjustment: one-screen summary and the formats of results, all from one record.

The record (`obseq.records.adjustment`) is what the result file holds: none of the reports can say something
else, and `read_json` gives it back to make them again.
"""

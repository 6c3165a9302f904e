"""The example of the page on least squares runs, and shows what it gives."""

import doctest
from pathlib import Path


def test_the_page_on_least_squares():
    page = Path(__file__).resolve().parents[2] / "docs" / "least-squares.md"
    failed, tried = doctest.testfile(str(page), module_relative=False)
    assert tried > 8
    assert failed == 0

"""The examples of the page and of the docstrings run."""

import doctest
from pathlib import Path

import obseq.crs.transformer

PAGE = Path(__file__).resolve().parents[2] / "docs" / "coordinate-systems.md"


def test_examples_of_the_page() -> None:
    outcome = doctest.testfile(str(PAGE), module_relative=False)
    assert outcome.attempted > 5
    assert outcome.failed == 0


def test_example_of_the_transformer() -> None:
    outcome = doctest.testmod(obseq.crs.transformer)
    assert outcome.attempted > 2
    assert outcome.failed == 0

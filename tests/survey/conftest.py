"""What several tests of surveys share: files, which pytest's importlib mode does not find, and a bench."""

import importlib
import sys
from pathlib import Path

import pytest

from obseq.diagnosis.policy import POLICY
from obseq.records.diagnosis import DiagnosisRecord
from obseq.survey.diagnosing.snooping import Snooped
from obseq.survey.fieldwork import Fieldwork

sys.path.insert(0, str(Path(__file__).parent))
TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"


@pytest.fixture
def planted(monkeypatch):
    """The bench that plants gross errors in random networks."""
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module("bench_gross_errors")


@pytest.fixture
def unsearched(monkeypatch):
    """Adjustments as they are: nobody looks for what is wrong, which is no matter of the test."""
    found = Snooped(DiagnosisRecord("undecided", 0.0, 0, (), "nobody looked"), POLICY)
    monkeypatch.setattr(Fieldwork, "_judged", lambda *_: found)


@pytest.fixture
def mistakes(monkeypatch):
    """What it plants."""
    monkeypatch.syspath_prepend(TOOLS)
    return importlib.import_module("gross_mistakes")

"""A small record with a story: a good distance, a bad direction, an observation that is not used."""

import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from obseq.records.adjustment import AdjustmentRecord

sys.path.insert(0, str(Path(__file__).parent))
GON = math.pi / 200.0


@pytest.fixture(scope="session")
def browser():
    """One browser for all tests of pages."""
    import browsing

    with browsing.chromium(browsing.BRIEF) as found:
        yield found


def observation(
    kind: str, start: str, end: str, value: float, sigma: float, residual: float, line: int
) -> dict[str, Any]:
    return {
        "type": kind,
        "from": start,
        "to": end,
        "value": value,
        "sigma": sigma,
        "residual": residual,
        "normalised_residual": residual / sigma,
        "file": "site.obs",
        "line": line,
        "active": True,
        "adjusted": value + residual,
    }


def point(name: str, x: float, y: float, precision: float) -> dict[str, Any]:
    crs = {"crs_x": 650000.0 + x, "crs_y": 6860000.0 + y, "crs_z": 35.0}
    return {"name": name, "x": x, "y": y, "z": 0.0, "sx": precision, "sy": precision / 2, "sz": 0.001} | crs


@pytest.fixture
def plain() -> dict[str, Any]:
    unused = observation("Dist", "A", "C", 30.0, 0.002, 0.5, 4) | {"active": False}
    return {
        "format": "obseq-adjustment",
        "version": 1,
        "n_observations": 3,
        "n_constraints": 6,
        "n_unknowns": 5,
        "redundancy": 4,
        "iterations": [{"sigma0": 120.5, "max_step": 2.5}, {"sigma0": 1.25, "max_step": 0.001}],
        "sigma0": 1.25,
        "global_test": {
            "sigma0": 1.25,
            "lower": 0.348,
            "upper": 1.669,
            "level": 0.05,
            "p_value": 0.39,
            "passed": True,
        },
        "converged": True,
        "frame": "RTL*650000*6860000*35*IGNF:LAMB93",
        "points_crs": "IGNF:LAMB93",
        "points": [
            point("A", 0.0, 0.0, 0.001),
            point("B", 100.0, 50.0, 0.004),
            point("C", 40.0, 90.0, 0.002),
        ],
        "stations": [{"origin": "A", "orientation": "#VERT", "g0": -50.0 * GON}],
        "observations": [
            observation("Dist", "A", "B", 111.803, 0.002, 0.001, 1),
            observation("Hz", "A", "C", 26.62 * GON, 0.001 * GON, -0.0031 * GON, 2),
            observation("Hz", "A", "B", 70.483 * GON, 0.001 * GON, 0.0004 * GON, 3),
            unused,
        ],
        "phases": [{"name": "read", "seconds": 0.25}, {"name": "adjust", "seconds": 1.5}],
    }


@pytest.fixture
def make(plain: dict[str, Any]) -> Callable[..., AdjustmentRecord]:
    """The record with other values of some of its fields, in their plain form."""

    def made(**changes: Any) -> AdjustmentRecord:
        return AdjustmentRecord.from_dict(plain | changes)

    return made


@pytest.fixture
def record(make: Callable[..., AdjustmentRecord]) -> AdjustmentRecord:
    return make()

"""The tables of docs/scaling.md: what they say of given figures, and that the page has their marks."""

import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).parents[2] / "tools" / "benchmarks"
sys.path.insert(0, str(TOOLS))

import scaling  # noqa: E402 (a tool, not part of the package)


def figures(n):
    """Of a network whose times are quadratic."""
    phases = {line.name.split(",")[0]: {"cpu": 1e-6 * n * n} for line in scaling.GROWTH}
    sizes = {"unknowns": 3 * n, "observations": 10 * n, "nnz_factor": n * n, "gigaflop": 1e-9 * n**2}
    return sizes | {"peak_mb": 1024.0 * n, "seconds": phases}


def test_growth_is_the_exponent_between_first_and_last_size():
    table = scaling.growth_table((100, 1000), [figures(100), figures(1000)]).splitlines()
    rows = {line.split(" | ")[0].strip("| "): line.strip("| ").split(" | ") for line in table}
    assert rows["unknowns"] == ["unknowns", "300", "3,000", "n^1.00"]
    assert rows["assembly, each iteration"][1:] == ["0.010", "1.0", "n^2.00"]


def test_what_does_not_gain_is_explained():
    table = scaling.threads_table(
        {"assembly": 1.0, "solution": 1.0, "files: read": 2.0}, {"assembly": 0.5, "solution": 1.0}
    )
    assembly, solution, read = table.splitlines()[2:]
    assert assembly == "| assembly | 1.0 | 0.50 | 2.00 |  |"
    assert solution == f"| solution | 1.0 | 1.0 | 1.00 | {scaling.WHY['solution']} |"
    assert read == f"| files: read | 2.0 | - | 1.00 | {scaling.FROM_FILES['read']} |"


@pytest.mark.parametrize("name", ["growth", "threads"])
def test_the_page_has_the_marks(name):
    page = scaling.PAGE.read_text("utf-8")
    assert scaling.written(page, name, "| new |").count("| new |") == 1
    with pytest.raises(ValueError, match="no marks for"):
        scaling.written("nothing", name, "")

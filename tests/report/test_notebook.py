"""The notebook of the documentation runs, and shows a network, a plan, residuals and reliability."""

import ast
import json
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).resolve().parents[2] / "docs" / "notebooks" / "first-network.ipynb"


def shown(source: str, names: dict[str, Any]) -> Any:
    """Runs a cell as a notebook does: the value of its last expression, if it ends with one."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, str(NOTEBOOK), "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), str(NOTEBOOK), "eval"), names)


def test_the_notebook_runs_and_shows_network_and_adjustment() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    names: dict[str, Any] = {}
    values = [shown("".join(cell["source"]), names) for cell in cells if cell["cell_type"] == "code"]
    pictures = [value._repr_html_() for value in values if hasattr(value, "_repr_html_")]
    assert len(pictures) == 2
    assert all("<svg" in picture for picture in pictures)
    assert "<ellipse" in pictures[1]
    for words in ("largest w", "redundancy", "detectable", "sigma0"):
        assert words in pictures[1]
    assert values[-1][0] == "Dist"

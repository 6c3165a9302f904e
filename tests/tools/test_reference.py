"""The reference pages are what the docstrings give, and have what people do every day."""

import importlib.util
import re
from pathlib import Path

TOOL = Path(__file__).resolve().parents[2] / "tools" / "reference.py"


ROOT = TOOL.parents[1]
CALLED = re.compile(r"^(network|adjustment|block|solution)\.(\w+)|\.(adjust|add_length|save)\(", re.MULTILINE)
TASKS = re.compile(r"## Ten everyday tasks.*?^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
CLASSES = {
    "network": "Network",
    "adjustment": "Adjustment",
    "block": "BundleAdjustment",
    "solution": "BundleSolution",
}


def pages() -> dict[Path, str]:
    spec = importlib.util.spec_from_file_location("reference", TOOL)
    assert spec is not None and spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool.pages()


def test_the_pages_are_those_of_the_docstrings() -> None:
    for path, text in pages().items():
        assert path.read_text(encoding="utf-8") == text, "run python tools/reference.py"


def test_everyday_tasks_are_numbered_lines_whose_words_are_in_the_reference() -> None:
    reference = "".join(pages().values())
    for name in ("examples.md", "first-block.md"):
        (text,) = TASKS.findall((ROOT / "docs" / name).read_text(encoding="utf-8"))
        assert re.findall(r"  # (\d+): ", text) == [str(number) for number in range(1, 11)]
        called = {(owner, word) for owner, word, _ in CALLED.findall(text) if owner}
        assert len(called) > 6
        for owner, word in called:
            assert f"`{CLASSES[owner]}.{word}`" in reference, (owner, word)

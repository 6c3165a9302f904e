"""Find which file of tests runs most of each module: it writes `tests/modules.toml`.

The tests run once, in one process. Every function of ours that is entered is counted for the file of tests
that enters it. Tests of the room of a module go before others. Who adds a module can write its line by hand;
`tests/test_architecture.py` holds that every module has one.
"""

import sys
from collections import Counter, defaultdict
from collections.abc import Generator
from pathlib import Path
from types import CodeType, FrameType

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ROOT / "src" / "obseq"
TABLE = ROOT / "tests" / "modules.toml"
FROM_LISTS = ("formulas", "codegen", "generated")
"""Rooms whose tests go over all that is in them."""
FIRST = "# Which file of tests runs most of a module: by tools/tested_by.py, or by hand.\n"


class Watch:
    """A plugin of pytest that notes the functions that each file of tests enters."""

    def __init__(self) -> None:
        self.entered: dict[str, set[CodeType]] = defaultdict(set)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Watches one test, fixtures included."""
        entered = self.entered[item.path.relative_to(ROOT).as_posix()]

        def enter(frame: FrameType, event: str, _: object) -> None:
            if event == "call":
                entered.add(frame.f_code)

        sys.setprofile(enter)
        try:
            return (yield)
        finally:
            sys.setprofile(None)


def modules() -> list[str]:
    """Every module that holds code, but those of rooms that are tested from lists."""
    found = (path.relative_to(SOURCES) for path in SOURCES.rglob("*.py") if not path.name.startswith("__"))
    return sorted(path.as_posix() for path in found if path.parts[0] not in FROM_LISTS)


def main() -> int:
    """Runs the tests and writes the table."""
    watch = Watch()
    code = pytest.main(["-q", "-n", "0", *sys.argv[1:]], plugins=[watch])
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for file, entered in watch.entered.items():
        for function in entered:
            counts[function.co_filename][file] += 1
    lines = [FIRST]
    for module in modules():
        found, own = counts[str(SOURCES / module)], f"tests/{module.partition('/')[0]}/"
        best = max(found, key=lambda file: (file.startswith(own), found[file], file), default="")
        lines.append(f'"{module}" = "{best}"\n')
    TABLE.write_text("".join(lines), encoding="utf-8")
    return int(code)


if __name__ == "__main__":
    sys.exit(main())

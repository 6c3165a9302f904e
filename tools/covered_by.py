"""Find which tests run each line of the library: `tools/mutation.py` asks the map that this makes.

The tests run once, in one process, under coverage.py. What a fixture of a module or a session runs counts
for every test that asks for it. Each folder, or file, of tests that is named is a part of the map, which
takes the place of what it was; several runs may go side by side.
It needs `obseq[mutation]`.

Example:
    python tools/covered_by.py tests/diagnosis tests/survey
"""

from __future__ import annotations

import json
import os
import sys
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Collection, Generator, Iterable

    from coverage import Coverage

ROOT = Path(__file__).resolve().parents[1]
MAP = ROOT / ".mutation"
IMPORTED = ""
"""The context of what runs before any test."""


@dataclass(eq=False)
class Watch:
    """A plugin of pytest that tells coverage.py which test runs, and notes how long each takes.

    Attributes:
        coverage: counts the lines.
        tests: of each test that passes, its seconds of processor and the shared fixtures it asks for.
    """

    coverage: Coverage
    tests: dict[str, tuple[float, list[str]]]
    running: list[str] = field(default_factory=lambda: [IMPORTED])

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        """Watches one test, fixtures of its own included."""
        began = sum(os.times()[:4])
        self._begin(item.nodeid)
        try:
            return (yield)
        finally:
            self._end()
            self.tests[item.nodeid] = round(sum(os.times()[:4]) - began, 2), _shared(item)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Generator[None, object, object]:
        """Watches a fixture that other tests use too."""
        if fixturedef.scope == "function":
            return (yield)
        self._begin(_key(fixturedef))
        try:
            return (yield)
        finally:
            self._end()

    def _begin(self, context: str) -> None:
        self.running.append(context)
        self.coverage.switch_context(context)

    def _end(self) -> None:
        self.running.pop()
        self.coverage.switch_context(self.running[-1])


def _key(fixture: Any) -> str:
    return f"@{fixture.baseid}:{fixture.argname}"


def _shared(item: pytest.Item) -> list[str]:
    """Fixtures of wider scope than a test that it asks for."""
    known = item._fixtureinfo.name2fixturedefs  # type: ignore[attr-defined]
    return sorted({_key(one) for found in known.values() for one in found if one.scope != "function"})


class Covered:
    """The map: which tests run a line."""

    def __init__(self) -> None:
        from coverage import CoverageData

        self.tests: dict[str, tuple[float, list[str]]] = {}
        self.lines = CoverageData(no_disk=True)
        for path in sorted(MAP.glob("*.json")):
            self.tests |= json.loads(path.read_text("utf-8"))
            part = CoverageData(str(path.with_suffix("")))
            part.read()
            self.lines.update(part)
        if not self.tests:
            raise SystemExit(f"No map of the tests is in {MAP}: run tools/covered_by.py first.")

    @cached_property
    def users(self) -> dict[str, list[str]]:
        """Tests by the shared fixtures that they ask for."""
        found: dict[str, list[str]] = {}
        for name, (_, shared) in self.tests.items():
            for one in shared:
                found.setdefault(one, []).append(name)
        return found

    def by_line(self, module: str) -> dict[int, set[str]]:
        """Tests of each line of a module, given by its path in the checkout."""
        contexts = self.lines.contexts_by_lineno(str(ROOT / module))
        return {line: self._tests(names) for line, names in contexts.items()}

    def forget_others(self, there: Collection[str]) -> None:
        """Forgets tests that are no more, or have other parameters than when they were measured."""
        self.tests = {name: entry for name, entry in self.tests.items() if name in there}

    def seconds(self, test: str) -> float:
        """What a test takes of a processor."""
        return self.tests[test][0]

    def of_files(self, files: Iterable[str]) -> set[str]:
        """Tests of files or folders."""
        begin = tuple(f"{name}{end}" for name in files for end in ("::", "/"))
        return {name for name in self.tests if name.startswith(begin)}

    def _tests(self, contexts: Iterable[str]) -> set[str]:
        found = {name for name in contexts if name in self.tests}
        return found.union(*(self.users.get(name, ()) for name in contexts))


def main() -> int:
    """Runs the tests that are named, each part by itself."""
    MAP.mkdir(exist_ok=True)
    return max([_measured(part) for part in sys.argv[1:] or ["tests"]])


def _measured(part: str) -> int:
    """Runs the tests of a folder or a file, and writes what they run."""
    from coverage import Coverage

    lines = MAP / part.strip("/").replace("/", "-").removesuffix(".py")
    coverage = Coverage(data_file=str(lines), include=[f"{ROOT}/src/obseq/*"], config_file=False)
    coverage.erase()
    watch, passed = Watch(coverage, {}), Passed()
    coverage.start()
    code = pytest.main(["-q", "-n", "0", "-m", "not slow", part], plugins=[watch, passed])
    coverage.stop()
    coverage.save()
    tests = {name: entry for name, entry in watch.tests.items() if name not in passed.others}
    lines.with_name(f"{lines.name}.json").write_text(json.dumps(tests, indent=0), encoding="utf-8")
    return int(code)


class Passed:
    """A plugin that notes the tests that did not pass: they judge nothing."""

    def __init__(self) -> None:
        self.others: set[str] = set()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Notes what failed or was skipped."""
        if not report.passed:
            self.others.add(report.nodeid)


if __name__ == "__main__":
    sys.exit(main())

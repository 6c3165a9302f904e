"""What the documentation shows is true: its Python runs, its commands succeed, its links lead somewhere."""

import doctest
import importlib.util
import pkgutil
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import obseq
from obseq.cli.main import main

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
WITH_EXAMPLES = [
    ROOT / "README.md",
    ROOT / "docs" / "first-network.md",
    ROOT / "docs" / "examples.md",
    ROOT / "docs" / "first-block.md",
    ROOT / "docs" / "camera-model.md",
    ROOT / "docs" / "aerial.md",
    ROOT / "docs" / "result-file.md",
    ROOT / "docs" / "epipolar.md",
    ROOT / "docs" / "projects.md",
    ROOT / "docs" / "planning.md",
    ROOT / "docs" / "scaling.md",
    ROOT / "docs" / "one-adjustment.md",
    ROOT / "docs" / "equation-families.md",
    ROOT / "docs" / "survey-files.md",
]
EXTENDING = {page.name for page in (ROOT / "docs" / "extend").glob("*.md")} - {"README.md"}
OF_ROOMS = {"coordinate-systems.md", "targets.md", "write-a-formula.md"} | EXTENDING
"""Pages whose examples are run by the tests of their rooms."""
DEMO = ROOT / "src" / "obseq" / "survey" / "data"
BLOCK = re.compile(r"^```(\w+)(?: (\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\((?!https?:)([^)#]+)")
COMMAND = re.compile(r"^(?:\.venv/bin/)?obseq (.*)$", re.MULTILINE)
SHOWN = "class TopoHz"
RUN = ("python", "sh")
MORE = re.compile(
    r"^\s*(?:from|import) (?:sympy|matplotlib|pandas|pyogrio|rasterio|ezdxf|jax|PIL)\b"
    r"|^\s*(?:from|import) obseq\.(?:formulas|codegen)\b"
    r"|^\s*(?:gencode|pytest|python tools|ruff|mypy)\b|^[^#\n]*\.(?:plot|frame)\(|\.(?:gpkg|kml|dxf)\b",
    re.MULTILINE,
)
"""What the extras are for, and what only a checkout has."""
SAYS_SO = re.compile(r"# (?:needs obseq\[\w+\]|in a checkout)")
LOCAL_POINTS = "1 PtA 0 0 10 0.001\n0 PtB 10 0 10\n0 PtC 10 10 10\n1 PtD 0 -10 10 0.001\n"
AERIAL = {
    "flight.opk": "A 700000 6600000 1500 0 0 0 c\nB 700400 6600000 1500 0 0 0 c\n",
    "camera.txt": "name = c\nppax = 500\nppay = 400\nfocal = 1000\nwidth = 1000\nheight = 800\n",
    "ground.asc": "ncols 20\nnrows 20\nxllcorner 699000\nyllcorner 6599000\ncellsize 100\n" + 400 * "100 ",
    "ties.mes": "".join(
        f"{p} A {x} {y}\n{p} B {x - 286} {y}\n"
        for p, x, y in [("P", 600, 300), ("Q", 700, 500), ("R", 300, 100), ("S", 900, 200), ("T", 450, 700)]
    ),
    "control.app": "".join(
        f"{p} 3 {700000 + 1.4 * (x - 500)} {6600000 - 1.4 * (y - 400)} 100\n"
        for p, x, y in [("P", 600, 300), ("Q", 700, 500), ("R", 300, 100), ("S", 900, 200), ("T", 450, 700)]
    ),
}
"""Two vertical shots 1400 m above flat ground, and points that both see."""
MODULES = [module.name for module in pkgutil.walk_packages(obseq.__path__, "obseq.")]


def blocks(page: Path) -> Iterator[tuple[str, str, str]]:
    """Language, name and text of each fenced block of a page."""
    yield from BLOCK.findall(page.read_text(encoding="utf-8"))


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with the files that examples read."""
    monkeypatch.chdir(tmp_path)
    for name in ("obs", "cor"):
        (tmp_path / f"site.{name}").write_bytes((DEMO / f"demo.{name}").read_bytes())
    (tmp_path / "survey.obs").write_bytes((DEMO / "demo.obs").read_bytes())
    (tmp_path / "points.cor").write_text(LOCAL_POINTS, encoding="utf-8")
    for name, text in AERIAL.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


@pytest.fixture
def project(site: Path) -> Path:
    """A project tree of two images with tie points, beside the files of examples."""
    from obseq.images import Camera, Poses
    from obseq.images.epipolar import OrientedCamera
    from obseq.project import pairs_text, write_orientation

    camera = Camera("Calib", 6000, 4000, focal=5000.0)
    centres = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]
    poses = Poses.of(["im1.tif", "im2.tif"], centres, [np.eye(3)] * 2, cameras="Calib")
    tree = site / "MMVII-PhgrProj"
    write_orientation(tree / "Ori" / "BA", poses, {"Calib": camera})
    scene = np.random.default_rng(1).uniform([-100, -100, 900], [200, 100, 1100], (30, 3))
    pairs = np.hstack([OrientedCamera(camera, poses[image]).project(scene) for image in poses])
    (tree / "TieP" / "All" / "im1.tif").mkdir(parents=True)
    (tree / "TieP" / "All" / "im1.tif" / "im2.tif.csv").write_text(pairs_text(pairs), encoding="utf-8")
    return site


class Checker(doctest.OutputChecker):
    """Where an example shows a result, it is that one; where it shows none, any will do."""

    def check_output(self, want: str, got: str, optionflags: int) -> bool:
        return not want or super().check_output(want, got, optionflags)


@pytest.mark.parametrize("page", WITH_EXAMPLES, ids=lambda page: page.name)
def test_examples_run(page: Path, project: Path) -> None:
    names: dict[str, object] = {}  # of a page: what one block defines, those after it use
    for language, name, text in blocks(page):
        if name:
            (project / name).write_text(text, encoding="utf-8")
        elif language == "python":
            exec(compile(text, f"{page.name}: {text.splitlines()[0]}", "exec"), names)
        elif language == "sh":
            for command in COMMAND.findall(text.replace("\\\n", " ")):
                assert main(shlex.split(command)) == 0, command


def test_no_page_has_examples_that_nothing_runs() -> None:
    with_code = {page for page in PAGES for language, _, _ in blocks(page) if language == "python"}
    assert {page.name for page in with_code - set(WITH_EXAMPLES)} == OF_ROOMS


def test_blocks_that_need_more_than_the_set_up_say_so_in_their_first_line() -> None:
    """The README's set-up installs what runs; extras, and the tools of a checkout, are something else."""
    more = [
        text for page in PAGES for language, _, text in blocks(page) if language in RUN and MORE.search(text)
    ]
    assert len(more) > 5
    silent = [text for text in more if not SAYS_SO.match(text)]
    assert silent == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    missing = [
        target
        for target in LINK.findall(page.read_text(encoding="utf-8"))
        if not (page.parent / target).exists()
    ]
    assert missing == []


def test_every_page_is_reached_from_the_index() -> None:
    linked = LINK.findall((ROOT / "docs" / "index.md").read_text(encoding="utf-8"))
    assert {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"} - set(linked) == set()


def test_the_formula_in_the_readme_is_the_one_in_use() -> None:
    (shown,) = (text for _, _, text in blocks(ROOT / "README.md") if SHOWN in text)
    written = (ROOT / "formulas" / "topography.py").read_text(encoding="utf-8")
    lines = [line.removesuffix('"""') for line in shown[shown.index(SHOWN) :].splitlines()]
    assert [line for line in lines if line not in written] == []


def test_the_demo_is_the_network_of_the_first_page() -> None:
    for _, name, text in blocks(ROOT / "docs" / "first-network.md"):
        if name:
            demo = (DEMO / name.replace("site", "demo")).read_text(encoding="utf-8")
            assert content(text) == content(demo), name


def content(text: str) -> list[list[str | float]]:
    """The first five fields of the lines that are not comments, numbers as numbers."""
    lines = (line.partition("*")[0].split()[:5] for line in text.splitlines())
    return [[field if field.isalpha() else float(field) for field in line] for line in lines if line]


def test_every_module_can_be_imported() -> None:
    for name in MODULES:
        if not name.startswith("obseq.generated."):
            importlib.import_module(name)


def has_examples(name: str) -> bool:
    """Whether the text of a module shows examples; the module itself need not be loaded for that."""
    spec = importlib.util.find_spec(name)
    return spec is not None and ">>> " in Path(spec.origin or "").read_text("utf-8")


@pytest.mark.parametrize("name", [name for name in MODULES if has_examples(name)])
def test_docstring_examples_run(name: str, site: Path) -> None:
    runner = doctest.DocTestRunner(Checker(), optionflags=doctest.NORMALIZE_WHITESPACE)
    for example in doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(name), name):
        assert runner.run(example).failed == 0


TASKS = re.compile(r"## Ten everyday tasks.*?^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
ASKED = re.compile(r"\b(network|adjustment|block|solution)\.(\w+)\(")


@pytest.mark.parametrize("name", ["examples.md", "first-block.md"])
def test_everyday_tasks_are_lines_whose_words_are_in_the_reference(name: str) -> None:
    """The reference is made of the docstrings of what the rooms export."""
    from obseq.images import AdjustedBlock, BundleAdjustment
    from obseq.survey import Adjustment, Network

    owners = {
        "network": Network,
        "adjustment": Adjustment,
        "block": BundleAdjustment,
        "solution": AdjustedBlock,
    }
    (text,) = TASKS.findall((ROOT / "docs" / name).read_text(encoding="utf-8"))
    assert re.findall(r"  # (\d+): ", text) == [str(number) for number in range(1, 11)]
    asked = set(ASKED.findall(text))
    assert len(asked) > 6
    assert [word for owner, word in asked if not getattr(owners[owner], word).__doc__] == []

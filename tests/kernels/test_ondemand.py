"""Members of families that are not generated: built once, kept, found again, and refused with a reason."""

import subprocess
import sys
from logging import LogRecord
from pathlib import Path

import numpy as np
import pytest

import obseq
from obseq.compilation import cache as machine_code
from obseq.formulas.radiometry import RadiomVignetLin
from obseq.kernels import derivatives, loading, ondemand

NAME = "RadiomVignetLin_2"
UNKNOWNS, OBSERVATIONS = [2.0, 3.0, 0.5, 0.25], [10.0, 1.0]
"""Albedo 2, gain 3, K = (0.5, 0.25); radiometry 10 at a squared distance 1: 10 / 1.75 - 6."""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for modules that are built; machine code, which goes by its content, is the user's."""
    code = machine_code.user_folder().resolve() / machine_code.KEPT_IN
    (tmp_path / "cache").mkdir()
    if code.is_dir():
        (tmp_path / "cache" / machine_code.KEPT_IN).symlink_to(code)
    monkeypatch.setenv("OBSEQ_CACHE", str(tmp_path / "cache"))
    loading.load.cache_clear()
    ondemand._say_once.cache_clear()
    machine_code._warn_once.cache_clear()
    return tmp_path / "cache"


def test_a_member_of_a_family_is_built_on_demand(cache: Path, logged: list[LogRecord]) -> None:
    calc = obseq.calculator(NAME)
    assert calc.name == NAME
    assert calc.unknowns == RadiomVignetLin(2).unknowns
    np.testing.assert_allclose(calc.values([UNKNOWNS], [OBSERVATIONS]), [[10 / 1.75 - 6]], rtol=1e-15)
    assert derivatives.check_one(calc, samples=5, seed=1).passed
    assert str(ondemand.folder() / f"{NAME}.py") in "".join(record.getMessage() for record in logged)
    assert cache in ondemand.folder().parents


def test_what_was_built_is_found_again_without_the_generator() -> None:
    obseq.calculator(NAME).values([UNKNOWNS], [OBSERVATIONS])
    script = (
        "import sys\nsys.modules['sympy'] = sys.modules['jinja2'] = None\nimport obseq\n"
        f"print(obseq.calculator({NAME!r}).values([{UNKNOWNS}], [{OBSERVATIONS}])[0, 0])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert float(done.stdout) == pytest.approx(10 / 1.75 - 6)


def test_without_the_generator_the_message_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ondemand, "can_build", lambda: False)
    with pytest.raises(obseq.FormulaError, match=r"RadiomVignetLin_5.*pip install \"obseq\[gencode\]\""):
        obseq.calculator(NAME)


@pytest.mark.parametrize("name", ["TopoHzz", "", "../TopoHz", "RadiomVignetLin_-1", "RadiomVignetLin_02"])
def test_a_name_that_means_nothing_is_refused(name: str, cache: Path) -> None:
    with pytest.raises(obseq.FormulaError, match=r"no formula is named .*nearest names"):
        obseq.calculator(name)
    assert not list(cache.rglob("*.py"))


def test_where_nothing_can_be_written_it_lives_in_memory_and_that_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, logged: list[LogRecord]
) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("OBSEQ_CACHE", str(tmp_path / "file"))
    for name in (NAME, "RadiomVignetLin_1"):
        calc = obseq.calculator(name)
        values = calc.values([[0.0] * len(calc.unknowns)], [OBSERVATIONS])
        np.testing.assert_allclose(values, [[10.0]], rtol=1e-15)
    (said,) = [record for record in logged if record.name == "obseq.kernels.ondemand"]
    assert "cannot be written" in said.getMessage() and "OBSEQ_CACHE" in said.getMessage()


@pytest.mark.parametrize("installed", [True, False])
def test_derivatives_along_a_direction_of_a_generated_formula(
    installed: bool, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From a kernel made on demand; without the generator, from the Jacobian."""
    monkeypatch.setattr(ondemand, "can_build", lambda: installed)
    calc = obseq.calculator("Dist3D")
    values, along = calc.directional_derivative([[0, 0, 0, 3, 4, 0]], [[4.5]], [[0, 0, 0, 1, 2, 7]])
    # The unit vector (3, 4, 0)/5 times the shift (1, 2, 7) of its end: 11/5.
    assert (values[0, 0], along[0, 0]) == pytest.approx((0.5, 2.2), rel=1e-15)
    assert bool(list(cache.rglob("Dist3D.py"))) is installed


def test_a_generated_formula_is_never_built(cache: Path) -> None:
    obseq.calculator("TopoHz")
    assert {path.name for path in cache.iterdir()} <= {machine_code.KEPT_IN}


@pytest.mark.parametrize(
    ("platform", "environment", "expected"),
    [
        ("linux", {}, "home/.cache/obseq"),
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches/obseq"),
        ("darwin", {}, "home/Library/Caches/obseq"),
        ("linux", {"OBSEQ_CACHE": "/mine"}, "/mine"),
    ],
)
def test_the_folder_is_the_platform_s(
    platform: str, environment: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("OBSEQ_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(Path, "home", lambda: Path("home"))
    monkeypatch.setattr(sys, "platform", platform)
    assert ondemand.user_folder() == Path(expected)


@pytest.mark.parametrize(
    "damage", [lambda text: text[: len(text) // 2], lambda text: text.replace("STRIDE", "LANES", 1)]
)
def test_a_damaged_module_is_built_again(damage, logged: list[LogRecord]) -> None:
    calc = obseq.calculator(NAME)
    expected = calc.values([UNKNOWNS], [OBSERVATIONS])
    path = ondemand.folder() / f"{NAME}.py"
    text = path.read_text("utf-8")
    assert damage(text) != text
    path.write_text(damage(text), "utf-8")
    loading.load.cache_clear()
    assert obseq.calculator(NAME).values([UNKNOWNS], [OBSERVATIONS]) == expected
    assert path.read_text("utf-8") == text
    assert any("is damaged: it is built again" in record.getMessage() for record in logged)


def test_without_the_generator_a_damaged_module_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    obseq.calculator(NAME)
    (ondemand.folder() / f"{NAME}.py").write_text("raise SystemExit('run')", "utf-8")
    loading.load.cache_clear()
    monkeypatch.setattr(ondemand, "can_build", lambda: False)
    with pytest.raises(obseq.FormulaError, match=r"RadiomVignetLin_2.py is damaged; to build it again"):
        obseq.calculator(NAME)


def test_a_module_that_others_may_write_is_not_run(logged: list[LogRecord]) -> None:
    obseq.calculator(NAME)
    path = ondemand.folder() / f"{NAME}.py"
    path.chmod(0o666)
    loading.load.cache_clear()
    assert obseq.calculator(NAME).name == NAME
    assert any("may be written by others" in record.getMessage() for record in logged)

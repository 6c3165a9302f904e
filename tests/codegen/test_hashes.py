"""What a generated module says of itself: the mathematics it comes from, its own text, what it calls."""

import re

import pytest

from obseq.codegen.compiler import derive
from obseq.codegen.modules import functions_hash, render_module, text_hash
from obseq.formulas import REGISTRY
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number
from obseq.formulas.functions import Scalar
from obseq.formulas.space import Dist3D

HASHES = re.compile(r"formula sha256:(\w+)  text sha256:(\w+)  functions sha256:(\w+)")


@pytest.fixture(scope="module")
def text() -> str:
    return render_module(Dist3D()).text


def test_the_three_hashes(text: str) -> None:
    (found,) = HASHES.findall(text)
    assert found == (derive(Dist3D()).digest, text_hash(text), functions_hash())


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("t2 = p2_y - p1_y", "t2 = p2_y + p1_y"),
        ("ROWS = 14", "ROWS = 15"),
        ("Distance between two points.", "Distance of two points."),
        ("formula sha256:", "formula sha256:0"),
    ],
)
def test_a_hand_edit_shows(text: str, before: str, after: str) -> None:
    edited = text.replace(before, after, 1)
    assert edited != text
    assert text_hash(edited) != HASHES.search(edited).group(2)


class _Sum(Formula):
    """One way to say it."""

    def residual(self, x: Number, y: Number) -> Scalar:
        return x + y


class _SameSum(Formula):
    """Another way, with other words, a source and a local variable."""

    source = "Somewhere"

    def residual(self, x: Number, y: Number) -> Scalar:
        total = x  # a comment
        total += y
        return total


class _Difference(Formula):
    """One way to say it."""

    def residual(self, x: Number, y: Number) -> Scalar:
        return x - y


class _OtherNames(Formula):
    """One way to say it."""

    def residual(self, x: Number, z: Number) -> Scalar:
        return x + z


def test_the_formula_hash_is_that_of_the_mathematics(monkeypatch: pytest.MonkeyPatch) -> None:
    for formula in (_Sum, _SameSum, _Difference, _OtherNames):
        monkeypatch.setattr(formula, "name", property(lambda self: "Sum"))
    digest = derive(_Sum()).digest
    assert derive(_SameSum()).digest == digest
    assert derive(_Difference()).digest != digest
    assert derive(_OtherNames()).digest != digest


def test_no_two_formulas_share_a_hash() -> None:
    sample = REGISTRY[::6]
    assert len({derive(formula).digest for formula in sample}) == len(sample)


def test_the_functions_hash_ignores_words_and_sees_code(monkeypatch: pytest.MonkeyPatch) -> None:
    from obseq.codegen.modules import _code_only

    source = 'def f(x):\n    """Says."""\n    return x + 1.0  # why\n'
    assert _code_only(source) == _code_only("def f(x):\n    return x + 1.0\n")
    assert _code_only(source) != _code_only("def f(x):\n    return x + 2.0\n")

"""What a generated module says of itself: the mathematics it comes from, its own text, what it calls."""

import re

import pytest
from unchanged import Seen

from obseq.codegen.compiler import derive
from obseq.codegen.dependencies import code_of, functions_hash
from obseq.codegen.pipeline import generate
from obseq.formulas import REGISTRY
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number
from obseq.formulas.functions import Scalar
from obseq.formulas.topography import Dist3D
from obseq.module_texts import text_hash

HASHES = re.compile(r"formula sha256:(\w+)  text sha256:(\w+)  functions sha256:(\w+)")


@pytest.fixture(scope="module")
def text() -> str:
    return generate(Dist3D()).text


def test_the_three_hashes(text: str) -> None:
    (found,) = HASHES.findall(text)
    assert found == (derive(Dist3D()).digest, text_hash(text), functions_hash(["sqrt", "keep_loop"]))


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


def test_no_two_formulas_share_a_hash(seen: Seen) -> None:
    sample = REGISTRY[::6]
    assert "distinct hashes" in seen or len({derive(formula).digest for formula in sample}) == len(sample)
    seen.add("distinct hashes")


MODULE = '''
import math
from elsewhere import wrap, unused

RATE = 2.0
A, B = 3.0, 4.0


@wrap
def inner(x):
    """Says."""
    return A * x  # why


def outer(x):
    return inner(x) + math.pi


def other(x):
    return RATE * x
'''


def test_the_functions_hash_sees_the_code_that_is_called_and_no_other() -> None:
    of_outer = code_of(MODULE, ["outer", "absent"])
    for unseen in ("Says.", "why", "RATE", "other"):
        assert unseen not in of_outer
    for before, after in [
        ("A, B = 3.0", "A, B = 3.5"),
        ("x) + math.pi", "x) - math.pi"),
        ("return A * x", "return A - x"),
        ("import wrap", "import cut as wrap"),
    ]:
        assert code_of(MODULE.replace(before, after), ["outer"]) != of_outer
    for before, after in [
        ("RATE = 2.0", "RATE = 2.5"),
        ("Says.", "Tells."),
        ("# why", "# whatever"),
        ("RATE * x", "0.0"),
    ]:
        assert code_of(MODULE.replace(before, after), ["outer"]) == of_outer


def test_the_functions_hash_is_that_of_what_a_kernel_calls() -> None:
    assert functions_hash(["sin"]) == functions_hash(["sin"]) != functions_hash(["sqrt"])
    assert functions_hash(["sinc_sqrt"]) != functions_hash(["cos_sqrt"])

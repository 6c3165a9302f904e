"""The text of kernels: short, readable, the same every time."""

import re
from typing import Annotated

from obseq.codegen.compiler import derive
from obseq.codegen.graphs.expression_graph import ExpressionGraph
from obseq.codegen.kernel_text import jacobian_kernel, value_kernel
from obseq.codegen.pipeline import generate
from obseq.codegen.printing import LONGEST_EXPRESSION, Printer, Store
from obseq.formulas import REGISTRY
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Number
from obseq.formulas.functions import Scalar, let, sin

FORMULAS = {formula.name: formula for formula in REGISTRY}

ROWS = "unknowns 0-5, observations 6, residuals 7, Jacobian 8-13"

DISTANCE = """\
def value_and_jacobian(tiles, n_tiles):
    ~Rows of each tile: @; one lane per observation.~
    for k in range(n_tiles):
        tile = k * ROWS * STRIDE
        for lane in range(LANES):
            at = tile + lane
            p1_x = tiles[at]
            p1_y = tiles[at + 1 * STRIDE]
            p1_z = tiles[at + 2 * STRIDE]
            p2_x = tiles[at + 3 * STRIDE]
            p2_y = tiles[at + 4 * STRIDE]
            p2_z = tiles[at + 5 * STRIDE]
            D = tiles[at + 6 * STRIDE]
            # residuals
            t1 = p2_x - p1_x
            t2 = p2_y - p1_y
            t3 = p2_z - p1_z
            t4 = sqrt(t1 * t1 + t2 * t2 + t3 * t3)
            tiles[at + 7 * STRIDE] = t4 - D
            # derivatives
            t5 = 1.0 / t4
            t6 = t1 * t5
            tiles[at + 8 * STRIDE] = -t6
            t7 = t2 * t5
            tiles[at + 9 * STRIDE] = -t7
            t8 = t3 * t5
            tiles[at + 10 * STRIDE] = -t8
            tiles[at + 11 * STRIDE] = t6
            tiles[at + 12 * STRIDE] = t7
            tiles[at + 13 * STRIDE] = t8
""".replace("~", '"""').replace("@", ROWS)


def test_golden_text() -> None:
    """The one kernel kept here whole, as a reading sample; `gencode --check` compares the others."""
    text = generate(FORMULAS["Dist3D"]).text
    start = text.index("def value_and_jacobian")
    assert text[start : start + len(DISTANCE)] == DISTANCE


class _Clashes(Formula):
    """Scalars named like words of the kernel, and an intermediate value named like a scalar."""

    def residual(
        self, tiles: Number, t1: Annotated[Number, "lane"], *, sin_: Annotated[Number, "sqrt"]
    ) -> Scalar:
        """Nothing in particular."""
        lane = let("lane", tiles * t1)
        return sin(lane) * lane + sin_


def test_names_do_not_clash() -> None:
    (lines,) = value_kernel(derive(_Clashes())).loops
    assert lines[:4] == [
        "keep_loop()",
        "tiles_ = tiles[at]",
        "lane_ = tiles[at + 1 * STRIDE]",
        "sqrt_ = tiles[at + 2 * STRIDE]",
    ]
    assert lines[4] == "lane__ = tiles_ * lane_"


def test_let_names_survive() -> None:
    lines = [line for loop in jacobian_kernel(derive(FORMULAS["TopoZen"])).loops for line in loop]
    assert any(line.startswith("horizontal = sqrt(") for line in lines)
    assert any(line.startswith("sight_x = ") for line in lines)


def test_a_quotient_used_once_is_a_division() -> None:
    graph = ExpressionGraph()
    x, y = graph.input("x"), graph.input("y")
    once = Printer(graph, {"x": "X", "y": "Y"}).loop([Store(graph.mul(x, graph.rcp(y)), "R")])
    assert once == ["x = X", "y = Y", "R = x / y"]
    twice = Printer(graph, {"x": "X", "y": "Y"}).loop(
        [Store(graph.mul(x, graph.rcp(y)), "R"), Store(graph.mul(y, graph.rcp(graph.mul(y, y))), "S")]
    )
    assert twice[-1] == "S = y / (y * y)"


def test_signs_and_parentheses() -> None:
    graph = ExpressionGraph()
    x, y, z = (graph.input(name) for name in "xyz")
    places = {name: name.upper() for name in "xyz"}

    def text(node: int) -> str:
        return Printer(graph, places).loop([Store(node, "R")])[-1]

    assert text(graph.sub(x, graph.sub(y, z))) == "R = x - (y - z)"
    assert text(graph.mul(x, graph.add(y, z))) == "R = x * (y + z)"
    assert text(graph.neg(graph.add(x, y))) == "R = -(x + y)"
    assert text(graph.sub(graph.mul(x, y), graph.mul(y, z))) == "R = x * y - y * z"
    assert text(graph.add(x, graph.constant(1.0))) == "R = 1.0 + x"
    assert text(graph.mul(graph.constant(-2.0), x)) == "R = -2.0 * x"


def test_long_expressions_are_cut() -> None:
    longest = LONGEST_EXPRESSION + 40
    for name in ("BlocRigid", "ClinoRot", "EqColinearityCamPPC_Stenope_Dist_Rad7_Dec2_XY5"):
        for loop in jacobian_kernel(derive(FORMULAS[name])).loops:
            assert max(len(line) for line in loop) < longest


def test_a_long_kernel_is_cut_in_two_loops() -> None:
    """The second loop loads what the first one parked, before it writes a result over it."""
    kernel = jacobian_kernel(derive(FORMULAS["EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1"]))
    first, second = kernel.loops
    parked = dict(
        re.fullmatch(r"(tiles\S* .*\S) = (.*)", line).groups() for line in first if line[:5] == "tiles"
    )
    loads = dict(reversed(line.split(" = ")) for line in second if " = tiles[" in line)
    assert 0 < len(parked) <= 8
    assert set(parked) <= set(loads)
    for place in parked:
        written = [k for k, line in enumerate(second) if line.startswith(f"{place} = ")]
        read = [k for k, line in enumerate(second) if line.endswith(f" = {place}")]
        assert len(read) == 1 and all(read[0] < k for k in written)
    assert any("1.0 / " in line for line in first)
    assert not any("1.0 / " in line or "sqrt(" in line for line in second)


def test_short_kernels_are_one_loop() -> None:
    for name in ("Dist3D", "TopoHz", "TopoDH", "BlocRigid"):
        assert len(jacobian_kernel(derive(FORMULAS[name])).loops) == 1

"""Loading kernels: only those asked for, quickly once they are compiled."""

import subprocess
import sys

import pytest

from obseq.kernels import formula_names, load


def test_descriptions_agree_with_the_layout() -> None:
    for name in formula_names():
        kernel = load(name)
        assert kernel.name == name
        n, p, m = len(kernel.unknowns), len(kernel.observations), len(kernel.residuals)
        assert kernel.first_result == n + p
        assert kernel.value_rows == n + p + m
        assert kernel.rows == n + p + m * (1 + n)
        assert kernel.directional_rows == n + p + n + 2 * m
        assert all(n + p + m <= row < kernel.rows for row, _ in kernel.constant_rows)
        starts = [block.start for block in kernel.blocks]
        assert starts == [sum(block.size for block in kernel.blocks[:k]) for k in range(len(starts))]
        assert sum(block.size for block in kernel.blocks) == n
        context = {k for block in kernel.blocks if block.context for k in range(*block.context)}
        assert context.isdisjoint(kernel.measured)
        assert sorted(context | set(kernel.measured)) == list(range(p))


def test_addresses_stay() -> None:
    kernel = load("Dist3D")
    assert kernel.value_address == kernel.value_address != kernel.value_and_jacobian_address
    assert kernel.directional_address not in (0, kernel.value_address, kernel.value_and_jacobian_address)


@pytest.mark.slow
def test_three_formulas_load_three() -> None:
    program = """
import sys
import obseq
for name in ("Dist3D", "TopoHz", "TopoZen"):
    obseq.calculator(name).values([[1.0] * len(obseq.calculator(name).unknowns)] * 2,
                                  [[1.0] * len(obseq.calculator(name).observations)] * 2)
loaded = [name for name in sys.modules if name.startswith("obseq.generated.")]
print(sorted(loaded))
"""
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    expected = ["index", "topography", *(f"topography.{name}" for name in ("dist3d", "topo_hz", "topo_zen"))]
    assert result.stdout.strip() == str([f"obseq.generated.{name}" for name in expected])

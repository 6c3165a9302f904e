"""
A formula of your own
=====================

A pendulum is timed at six lengths. The mark from which lengths count is not at its axis: this offset is
unknown, and gravity too. The equation is one class. Derivatives and fast code follow from it.
"""

import matplotlib.pyplot as plt
import numpy as np

import obseq
from obseq.codegen import compile_formula
from obseq.formulas import Formula
from obseq.formulas.blocks import Number
from obseq.formulas.functions import Scalar, sqrt


class Pendulum(Formula):
    """Period of a pendulum, and the length that was read. Defined for lengths and gravities above zero."""

    source = "Huygens, Horologium Oscillatorium"

    def residual(self, offset: Number, gravity: Number, *, length: Number, period: Number) -> Scalar:
        """Computed minus timed, seconds."""
        return 6.283185307179586 * sqrt((length + offset) / gravity) - period


lengths = np.linspace(0.3, 1.3, 6)
periods = 2 * np.pi * np.sqrt((lengths + 0.012) / 9.81) + np.random.default_rng(3).normal(0.0, 0.001, 6)
system = obseq.LeastSquares()
offset = system.add_vectors(["offset"], [[0.0]], ["offset"])
gravity = system.add_vectors(["gravity"], [[10.0]], ["gravity"])
timed = system.add(
    compile_formula(Pendulum()),
    {"offset": offset.repeat(6), "gravity": gravity.repeat(6)},
    np.column_stack([lengths, periods]),
    sigmas=0.001,
)
result = system.solve(covariance=gravity)
print(f"gravity {result.values(gravity)[0, 0]:.3f} m/s^2, offset {1000 * result.values(offset)[0, 0]:.1f} mm")

# %%
plt.stem(lengths, 1000 * np.ravel(result.residuals(timed)))
plt.xlabel("length, m")
plt.ylabel("residual, ms")
plt.show()

# %%
# Next: :doc:`write a formula <../write-a-formula>`.

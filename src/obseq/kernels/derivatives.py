"""Generated derivatives against sixth-order central differences of the value kernels, at random inputs."""

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from obseq.arrays import FloatArray
from obseq.dataclass import dataclass
from obseq.kernels import provenance
from obseq.kernels.calculator import Calculator, calculator
from obseq.kernels.layout import Block
from obseq.kernels.loading import Kernel, formula_names

THRESHOLD = 1e-9
"""Largest error of a derivative that passes, relative to the largest entry of its row of the Jacobian."""

STEP = 1e-3
"""Step of the differences, as a part of the half width of an unknown."""

RELIABLE = THRESHOLD / 4
"""Disagreement of the differences with one and with two steps, beyond which they say nothing."""

OFFSETS = np.array([-6, -4, -3, -2, -1, 1, 2, 3, 4, 6])
"""Steps from the centre where values are taken: those of a stencil, and of the same one twice as wide."""

NARROW = np.array([0, 0, -1, 9, -45, 45, -9, 1, 0, 0]) / 60
WIDE = np.array([-1, 9, 0, -45, 0, 0, 45, 0, -9, 1]) / 120

DEFAULT = (0.0, 1.0)
SMALL = (0.0, 0.1)
FRAME = 9
"""Context values of rotations, and of directions: an orthonormal frame."""

MOST_DRAWS = 30
ROWS_AT_ONCE = 1 << 14


@dataclass(frozen=True)
class DerivativeCheck:
    """How far the derivatives of one formula are from finite differences.

    Attributes:
        name: Name of the formula.
        worst_relative_error: Largest error, relative to the largest entry of its row of the Jacobian;
            infinite when the formula is not finite and smooth at enough of the random inputs.
        residual: Residual of the worst entry.
        unknown: Unknown of the worst entry.
        passed: True when the error is at most `THRESHOLD`, and the kernel as old as its formula.
        stale: Why it is not; empty when it is.
    """

    name: str
    worst_relative_error: float
    residual: str
    unknown: str
    passed: bool
    stale: str = ""


def check(
    names: Sequence[str] | None = None,
    samples: int = 40,
    seed: int = 1,
    progress: Callable[[str], None] | None = None,
) -> list[DerivativeCheck]:
    """Compares the derivatives of formulas with differences of their values.

    Inputs are drawn where the generated module says that the formula lives. An input is drawn again when the
    formula is not finite there, or when differences with one and with two steps disagree: a jump of an angle,
    a kink or a singular place is too near. That judgement never looks at the derivative under test.

    Args:
        names: Names of the formulas; all generated ones when None.
        samples: Random inputs for each formula.
        seed: Seed of the random inputs; those of a formula do not depend on the other names.
        progress: Called with the name of each formula.

    Raises:
        FormulaError: No generated formula has one of the names.
    """
    checks = []
    for name in formula_names() if names is None else names:
        if progress:
            progress(f"checking the derivatives of {name}")
        found, stale = check_one(calculator(name), samples, seed), provenance.staleness(name)
        checks.append(replace(found, stale=stale, passed=found.passed and not stale))
    return checks


def check_one(calculator: Calculator, samples: int, seed: int) -> DerivativeCheck:
    """The check of one formula at some random inputs."""
    if not calculator.residuals or not calculator.unknowns:
        return DerivativeCheck(calculator.name, 0.0, "", "", True)
    worst, found = _worst_errors(calculator, samples, seed)
    residual, unknown = np.unravel_index(int(np.argmax(worst)), worst.shape)
    error = float(worst[residual, unknown]) if 2 * found >= samples else math.inf
    return DerivativeCheck(
        calculator.name,
        error,
        calculator.residuals[int(residual)],
        calculator.unknowns[int(unknown)],
        error <= THRESHOLD,
    )


def _worst_errors(calculator: Calculator, samples: int, seed: int) -> tuple[FloatArray, int]:
    """((n_residuals, n_unknowns) largest relative errors, number of inputs that they come from)."""
    random = np.random.default_rng([seed, zlib.crc32(calculator.name.encode())])
    worst = np.zeros((len(calculator.residuals), len(calculator.unknowns)))
    found = 0
    for _ in range(MOST_DRAWS):
        unknowns, observations = draw(calculator.kernel, samples - found, random)
        errors = relative_errors(calculator, unknowns, observations)
        worst = np.maximum(worst, errors.max(axis=0, initial=0.0))
        found += len(errors)
        if found >= samples:
            break
    return worst, found


def relative_errors(calculator: Calculator, unknowns: FloatArray, observations: FloatArray) -> FloatArray:
    """Errors of the Jacobian relative to the largest entry of its rows, at the inputs where differences hold.

    Args:
        calculator: The formula.
        unknowns: (n, n_unknowns).
        observations: (n, n_observations).

    Returns:
        (at most n, n_residuals, n_unknowns).
    """
    with np.errstate(all="ignore"):
        narrow, wide = differences(calculator, unknowns, observations)
        _, jacobian = calculator.values_and_jacobian(unknowns, observations)
        size = np.abs(narrow).max(axis=2, keepdims=True)
        size[size == 0.0] = 1.0
        reliable = (np.abs(narrow - wide) <= RELIABLE * size).all(axis=(1, 2))
        errors: FloatArray = (np.abs(jacobian - narrow) / size)[reliable]
    errors[np.isnan(errors)] = math.inf
    return errors


def differences(
    calculator: Calculator, unknowns: FloatArray, observations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """The Jacobian by central differences with one and with two steps, each (n, n_residuals, n_unknowns)."""
    steps = STEP * np.array([half_width(calculator.kernel, name) for name in calculator.unknowns])
    shape = (len(unknowns), len(calculator.residuals), len(calculator.unknowns))
    narrow, wide = np.empty(shape), np.empty(shape)
    for j, step in enumerate(steps):
        values, moved = _along(calculator, unknowns, observations, j, step)
        narrow[:, :, j] = np.einsum("k,nkm->nm", NARROW, values) / moved
        wide[:, :, j] = np.einsum("k,nkm->nm", WIDE, values) / moved
    return narrow, wide


def _along(
    calculator: Calculator, unknowns: FloatArray, observations: FloatArray, j: int, step: float
) -> tuple[FloatArray, FloatArray]:
    """(n, 10, n_residuals) values around each input along one unknown, and the (n, 1) steps as rounded."""
    n, points = len(unknowns), len(OFFSETS)
    moved = np.repeat(unknowns, points, axis=0)
    moved[:, j] += np.tile(OFFSETS * step, n)
    fixed = np.repeat(observations, points, axis=0)
    parts = [
        calculator.values(moved[k : k + ROWS_AT_ONCE], fixed[k : k + ROWS_AT_ONCE])
        for k in range(0, n * points, ROWS_AT_ONCE)
    ]
    values = np.concatenate(parts).reshape(n, points, -1)
    values -= values[:, :1].copy()  # so that the differences of a constant are exactly 0
    ends = moved[:, j].reshape(n, points)
    return values, ((ends[:, -1] - ends[:, 0]) / (OFFSETS[-1] - OFFSETS[0]))[:, None]


def draw(kernel: Kernel, n: int, random: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Random admissible inputs: (n, n_unknowns) unknowns and (n, n_observations) observations.

    Scalars are uniform in the interval that the module calls typical, else in [-1, 1]; small displacements
    of blocks with a context in [-0.1, 0.1]. A context of nine values is an orthonormal frame, as those of
    rotations and directions are.
    """
    unknowns = _uniform(kernel, kernel.unknowns, n, random)
    observations = _uniform(kernel, kernel.observations, n, random)
    for block in kernel.blocks:
        if block.context and block.context[1] - block.context[0] == FRAME:
            observations[:, slice(*block.context)] = _frames(n, random)
    return unknowns, observations


def _uniform(kernel: Kernel, names: tuple[str, ...], n: int, random: np.random.Generator) -> FloatArray:
    intervals = np.array([interval(kernel, name) for name in names]).reshape(-1, 2)
    drawn: FloatArray = intervals[:, 0] + intervals[:, 1] * random.uniform(-1, 1, (n, len(names)))
    return drawn


def interval(kernel: Kernel, name: str) -> tuple[float, float]:
    """(centre, half width) of where a scalar is drawn."""
    if name in kernel.typical:
        return kernel.typical[name]
    tangent = (block for block in kernel.blocks if block.context)
    return SMALL if any(name in _names(kernel, block) for block in tangent) else DEFAULT


def half_width(kernel: Kernel, name: str) -> float:
    """The scale of an unknown, that its step is a part of: its half width, else its size."""
    centre, half = interval(kernel, name)
    return half or abs(centre) or DEFAULT[1]


def _names(kernel: Kernel, block: Block) -> tuple[str, ...]:
    return kernel.unknowns[block.start : block.start + block.size]


def _frames(n: int, random: np.random.Generator) -> FloatArray:
    """(n, 9) rows of random rotation matrices: any rotation, and as well a normal with its two tangents."""
    frames, _ = np.linalg.qr(random.normal(size=(n, 3, 3)))
    frames[np.linalg.det(frames) < 0] *= -1.0
    flat: FloatArray = frames.reshape(n, 9)
    return flat

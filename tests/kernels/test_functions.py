import hashlib
import io
import linecache
import math
import re
from functools import cache
from pathlib import Path

import mpmath
import numpy as np
import pytest
from vectorised import Verdicts

from obseq.arrays import FloatArray
from obseq.compilation import compiled, host
from obseq.compilation.digests import CONTRACT
from obseq.compilation.numba_compiler import optimised
from obseq.kernels import functions
from obseq.writing import write_all

DIGITS = 110
"""Of the references: cancellation takes at most 66 (s = 1e-60 beside z = 1e3, squared)."""

RANDOM = np.random.default_rng(7)


def _uniform(low, high, n=400):
    return RANDOM.uniform(low, high, n)


def _logarithmic(low, high, n=400):
    return np.exp(RANDOM.uniform(math.log(low), math.log(high), n))


def _signed(values):
    return np.concatenate([values, -values])


def _sinc_sqrt(s):
    root = mpmath.sqrt(s)
    return mpmath.sin(root) / root


def _sinc_sqrt_slope(s):
    root = mpmath.sqrt(s)
    return (mpmath.cos(root) - mpmath.sin(root) / root) / (2 * s)


def _angle_ratio(s, z):
    root = mpmath.sqrt(s)
    return mpmath.atan2(root, z) / root


def _angle_ratio_slope(ratio, s, z):
    return (z / (s + z * z) - _angle_ratio(s, z)) / (2 * s)


def _axial_sum(s, z):
    return mpmath.sqrt(s + z * z) + z


def _vectors(s, z):
    """Squared distances and components along the axis: all angles from the axis, both ways."""
    return np.repeat(s, len(z)), np.tile(z, len(s))


WIDE = _signed(np.concatenate([_logarithmic(1e-300, 1e-3), _uniform(0, 10), _logarithmic(10, 1e6)]))
UNIT = _signed(np.concatenate([_logarithmic(1e-300, 1), 1 - _logarithmic(1e-16, 1), _uniform(0, 1)]))
POSITIVE = _logarithmic(1e-200, 1e200)
AROUND_AXIS = _vectors(
    np.concatenate([_logarithmic(1e-60, 1e3, 60), _uniform(0, 4, 60)]),
    _signed(np.concatenate([_logarithmic(1e-3, 1e3, 10), _uniform(0, 2, 10)])),
)
RATIOS = np.arctan2(np.sqrt(AROUND_AXIS[0]), AROUND_AXIS[1]) / np.sqrt(AROUND_AXIS[0])

CASES = {
    "sin": (mpmath.sin, (WIDE,), 0.8),
    "cos": (mpmath.cos, (WIDE,), 0.8),
    "tan": (mpmath.tan, (WIDE,), 2.0),
    "atan": (mpmath.atan, (_signed(POSITIVE),), 1.6),
    "atan2": (mpmath.atan2, (_signed(POSITIVE), RANDOM.permutation(_signed(POSITIVE))), 1.6),
    "asin": (mpmath.asin, (UNIT,), 2.0),
    "acos": (mpmath.acos, (UNIT,), 2.0),
    "exp": (mpmath.exp, (np.concatenate([WIDE[abs(WIDE) < 708], _uniform(-708, 709.7, 2000)]),), 1.0),
    "log": (mpmath.log, (np.concatenate([_logarithmic(1e-307, 1e308), _uniform(0.5, 2, 2000)]),), 1.0),
    "sinc_sqrt": (_sinc_sqrt, (np.concatenate([_logarithmic(1e-300, 2), _uniform(0, 6)]),), 2.5),
    "sinc_sqrt_slope": (_sinc_sqrt_slope, (np.concatenate([_logarithmic(1e-15, 2), _uniform(0, 10)]),), 2.5),
    "cos_sqrt": (lambda s: mpmath.cos(mpmath.sqrt(s)), (_uniform(0, 1),), 1.5),
    "angle_ratio": (_angle_ratio, AROUND_AXIS, 3.0),
    "angle_ratio_slope": (_angle_ratio_slope, (RATIOS, *AROUND_AXIS), 8.0),
    "axial_sum": (_axial_sum, AROUND_AXIS, 2.5),
    "normalised_ratio": (lambda a, b: (a - b) / max(a, b), (_uniform(0, 9), _uniform(0, 9)), 1.5),
    "normalised_ratio_slope": (
        lambda a, b: 1 / b if a < b else b / a**2,
        (_uniform(0, 9), _uniform(0, 9)),
        1.5,
    ),
}
"""Name: (reference, arguments, largest error in units in the last place), as the module documents."""


@cache
def _loop(name, count):
    """The function in a loop over arrays, compiled as kernels are."""
    taken = ", ".join(f"{argument}: 'FloatArray'" for argument in "abc"[:count])
    items = ", ".join(f"{argument}[i]" for argument in "abc"[:count])
    text = (
        f"def loop(out: 'FloatArray', {taken}) -> None:\n for i in range(len(out)):\n  out[i] = f({items})\n"
    )
    file = f"<loop of {name}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    scope = {"f": getattr(functions, name), "__name__": __name__}
    exec(compile(text, file, "exec"), scope)
    return compiled(flags=CONTRACT)(scope["loop"])


def _evaluate(name, *arguments):
    out = np.empty(len(arguments[0]))
    _loop(name, len(arguments))(out, *(np.ascontiguousarray(argument, dtype=float) for argument in arguments))
    return out


PACKED, CALL = r"v(?:add|sub|mul|f[n]?m(?:add|sub)\d+)pd", r"call\S*\s+\S*(sin|cos|tan|exp|log)\b"
"""What machine code has of arithmetic on vectors, and must not have."""

STATE = f"{mpmath.__version__} {hashlib.sha256(Path(__file__).read_bytes()).hexdigest()}"


@pytest.fixture
def exact(request, pytestconfig) -> FloatArray:
    """What a function is at the arguments of its case, as sums of two numbers (2, n): kept with this file."""
    name, cache = request.getfixturevalue("name"), getattr(pytestconfig, "cache", None)
    path = None if cache is None else cache.mkdir("obseq-references") / f"{name}.npz"
    if path is not None and path.is_file():
        with np.load(path) as kept:
            if kept["state"] == STATE:
                return kept["exact"]
    found = _computed(*CASES[name][:2])
    if path is not None:
        content = io.BytesIO()
        np.savez(content, state=STATE, exact=found)
        write_all({path: content.getvalue()})
    return found


def _computed(reference, arguments) -> FloatArray:
    with mpmath.workdps(DIGITS):
        columns = [map(mpmath.mpf, values.tolist()) for values in arguments]
        values = [reference(*row) for row in zip(*columns, strict=True)]
        return np.array([[float(value), float(value - float(value))] for value in values]).T


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_accuracy_in_units_in_the_last_place(name, exact):
    _, arguments, bound = CASES[name]
    computed = _evaluate(name, *arguments)
    errors = abs(computed - exact[0] - exact[1]) / np.spacing(abs(exact[0]))
    worst = int(np.argmax(errors))
    assert errors[worst] <= bound, (
        name,
        [float(a[worst]) for a in arguments],
        computed[worst],
        errors[worst],
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_loop_around_it_is_vectorised(name):
    verdicts = Verdicts(f"{PACKED} {CALL}")
    routine = _loop(name, len(CASES[name][1])).routine
    if routine.symbol in verdicts:
        return
    machine = host.machine(routine.signature.wide)
    module = optimised(routine.function, routine.signature, routine.symbol, machine)
    assembly = machine.emit_assembly(module)
    assert len(re.findall(PACKED, assembly)) >= 2, name
    assert not re.search(CALL, assembly), name
    verdicts.add(routine.symbol)


INF, NAN = math.inf, math.nan
PI = math.pi

SPECIAL = {
    "exp": [((0.0,), 1.0), ((-INF,), 0.0), ((INF,), INF), ((710.0,), INF), ((-746.0,), 0.0), ((NAN,), NAN)],
    "log": [((1.0,), 0.0), ((0.0,), -INF), ((-1.0,), NAN), ((INF,), INF), ((NAN,), NAN)],
    "tan": [((0.0,), 0.0), ((1e7,), NAN)],
    "sinc_sqrt": [((0.0,), 1.0), ((1e-320,), 1.0), ((-1.0,), NAN)],
    "sinc_sqrt_slope": [((0.0,), -1 / 6), ((NAN,), NAN)],
    "cos_sqrt": [((0.0,), 1.0), ((PI**2,), -1.0)],
    "angle_ratio": [((0.0, 4.0), 0.25), ((0.0, -4.0), NAN), ((0.0, 0.0), NAN), ((1.0, 0.0), PI / 2)],
    "angle_ratio_slope": [((0.5, 0.0, 2.0), -1 / 24), ((NAN, 0.0, -2.0), NAN)],
    "axial_sum": [((0.0, 3.0), 6.0), ((0.0, -3.0), 0.0), ((16.0, 3.0), 8.0), ((16.0, -3.0), 2.0)],
    "normalised_ratio": [
        ((2.0, 2.0), 0.0),
        ((0.0, 0.0), 0.0),
        ((1.0, 2.0), -0.5),
        ((4.0, 1.0), 0.75),
        ((-1.0, 2.0), -1.0),
        ((2.0, -1.0), 1.0),
        ((-1.0, -2.0), 0.0),
        ((NAN, 1.0), NAN),
    ],
    "normalised_ratio_slope": [
        ((2.0, 2.0), 0.5),
        ((0.0, 0.0), 0.0),
        ((1.0, 4.0), 0.25),
        ((4.0, 1.0), 1 / 16),
        ((-1.0, 2.0), 0.0),
        ((2.0, -1.0), 0.0),
        ((NAN, 1.0), NAN),
    ],
}
"""Values at special arguments, worked out by hand."""


@pytest.mark.slow
@pytest.mark.parametrize("name", SPECIAL)
def test_special_values(name):
    arguments, expected = zip(*SPECIAL[name], strict=True)
    computed = _evaluate(name, *np.array(arguments).T)
    np.testing.assert_allclose(computed, expected, rtol=4e-16, err_msg=name)


@pytest.mark.slow
def test_subnormal_numbers():
    x = np.array([-708.5, -720.0, -744.0])
    np.testing.assert_allclose(_evaluate("exp", x), np.exp(x), rtol=0, atol=5e-324)
    y = np.array([5e-324, 1e-310, 2.2e-308])
    np.testing.assert_allclose(_evaluate("log", y), np.log(y), rtol=2e-16)


@pytest.mark.slow
def test_fish_eye_functions_are_exact_in_the_backward_cone():
    radius = np.array([1e-3, 1e-5, 1e-9])
    ratio = _evaluate("angle_ratio", radius**2, np.full(3, -1.0))
    np.testing.assert_allclose(ratio * radius, PI - np.arctan(radius), rtol=4e-16)

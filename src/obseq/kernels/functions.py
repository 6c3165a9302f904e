"""Elementary functions for kernels: branch-free, so that the lane loop around them is vectorised.

Accuracy (against 60-digit arithmetic, in units in the last place of the result):

| function | domain | worst error |
|---|---|---|
| sin, cos | abs(x) <= 1e6; not a number beyond | 0.8 ulp |
| atan2 | all finite arguments but (0, 0), which gives not a number | 1.6 ulp |
| asin | abs(x) <= 1 | 2.0 ulp |
| exp, log | those of the C library | 1 ulp |

The polynomials are those of the public fdlibm (Sun Microsystems, 1993); reductions follow Cody and Waite.
Kernels carry a hash of this module: numba's cache does not see a change in a function that a kernel calls.
"""

import math
from math import exp, log, sqrt
from typing import Any

import numpy as np
from numba import njit

__all__ = ["asin", "atan2", "cos", "exp", "log", "sin", "sqrt", "wrap_angle"]

inline: Any = njit(fastmath={"contract"}, error_model="numpy", forceinline=True)

TWO_OVER_PI = 6.36619772367581382433e-01
HALF_PI_1 = 1.57079632673412561417e00
HALF_PI_2 = 6.07710050630396597660e-11
HALF_PI_3 = 2.02226624871116645580e-21
HALF_PI_3_TAIL = 8.47842766036889956997e-32
LARGEST_ANGLE = 1.0e6

S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11

A0, A1, A2 = 3.33333333333329318027e-01, -1.99999999998764832476e-01, 1.42857142725034663711e-01
A3, A4, A5 = -1.11111104054623557880e-01, 9.09088713343650656196e-02, -7.69187620504482999495e-02
A6, A7, A8 = 6.66107313738753120669e-02, -5.83357013379057348645e-02, 4.97687799461593236017e-02
A9, A10 = -3.65315727442169155270e-02, 1.62858201153657823623e-02

QUARTER_PI, QUARTER_PI_TAIL = 7.85398163397448278999e-01, 3.06161699786838301793e-17
HALF_PI, HALF_PI_TAIL = 1.57079632679489655800e00, 6.12323399573676603587e-17
PI, PI_TAIL = 3.14159265358979311600e00, 1.22464679914735317720e-16
TAN_EIGHTH_PI = 0.41421356237309503


@inline
def _reduce(x):  # type: ignore[no-untyped-def]
    """(quadrant, remainder, its tail): x = quadrant pi/2 + remainder, quadrant a rounded float."""
    quadrant = np.rint(x * TWO_OVER_PI)
    first = x - quadrant * HALF_PI_1
    second = quadrant * HALF_PI_2
    middle = first - second
    lost = (first - middle) - second
    third = quadrant * HALF_PI_3 - lost
    remainder = middle - third
    tail = ((middle - remainder) - third) - quadrant * HALF_PI_3_TAIL
    return quadrant, remainder, tail


@inline
def _sine(x, tail):  # type: ignore[no-untyped-def]
    """Sine on [-pi/4, pi/4]."""
    z = x * x
    v = z * x
    r = S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))
    return x - ((z * (0.5 * tail - v * r) - tail) - v * S1)


@inline
def _cosine(x, tail):  # type: ignore[no-untyped-def]
    """Cosine on [-pi/4, pi/4]."""
    z = x * x
    r = z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
    half = 0.5 * z
    w = 1.0 - half
    return w + (((1.0 - w) - half) + (z * r - x * tail))


@inline
def _select(quadrant, x, tail):  # type: ignore[no-untyped-def]
    """Sine of quadrant pi/2 + x, for a quadrant that is a whole float."""
    turn = quadrant - 4.0 * np.floor(0.25 * quadrant)
    sine, cosine = _sine(x, tail), _cosine(x, tail)
    value = sine if turn == 0.0 or turn == 2.0 else cosine
    return -value if turn >= 2.0 else value


@inline
def sin(x):  # type: ignore[no-untyped-def]
    """Sine of x radians."""
    quadrant, remainder, tail = _reduce(x)
    value = _select(quadrant, remainder, tail)
    return value if abs(x) <= LARGEST_ANGLE else math.nan


@inline
def cos(x):  # type: ignore[no-untyped-def]
    """Cosine of x radians."""
    quadrant, remainder, tail = _reduce(x)
    value = _select(quadrant + 1.0, remainder, tail)
    return value if abs(x) <= LARGEST_ANGLE else math.nan


@inline
def _arc_tangent(t):  # type: ignore[no-untyped-def]
    """t minus the arc tangent of t, for abs(t) <= tan(pi/8)."""
    z = t * t
    w = z * z
    even = z * (A0 + w * (A2 + w * (A4 + w * (A6 + w * (A8 + w * A10)))))
    odd = w * (A1 + w * (A3 + w * (A5 + w * (A7 + w * A9))))
    return t * (even + odd)


@inline
def atan2(y, x):  # type: ignore[no-untyped-def]
    """Angle of the vector (x, y) in (-pi, pi]."""
    height, width = abs(y), abs(x)
    steep = height > width
    small = width if steep else height
    large = height if steep else width
    beyond = small > TAN_EIGHTH_PI * large
    t = (small - large if beyond else small) / (small + large if beyond else large)
    correction = _arc_tangent(t)
    # The angle is high + low + sign (t - correction), summed from the smallest term.
    high, low, sign = (QUARTER_PI, QUARTER_PI_TAIL, 1.0) if beyond else (0.0, 0.0, 1.0)
    if steep:
        high, low, sign = HALF_PI - high, HALF_PI_TAIL - low, -sign
    if x < 0.0:
        high, low, sign = PI - high, PI_TAIL - low, -sign
    return math.copysign(high - ((sign * correction - low) - sign * t), y)


@inline
def asin(x):  # type: ignore[no-untyped-def]
    """Arc sine of x in radians; not a number beyond [-1, 1]."""
    return atan2(x, sqrt((1.0 - x) * (1.0 + x)))


@inline
def wrap_angle(angle):  # type: ignore[no-untyped-def]
    """An angle brought to (-pi, pi] by whole turns."""
    return angle - (2.0 * PI) * np.ceil((angle - PI) * (0.5 / PI))

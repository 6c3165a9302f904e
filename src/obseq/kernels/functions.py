"""Elementary functions for kernels: branch-free, so that the lane loop around them is vectorised.

Accuracy (against 60-digit arithmetic, in units in the last place of the result):

| function | domain | worst error |
|---|---|---|
| sin, cos | abs(x) <= 1e6; not a number beyond | 0.8 ulp |
| tan | abs(x) <= 1e6; not a number beyond | 2.0 ulp |
| atan2, atan | all finite arguments but (0, 0), which gives not a number | 1.6 ulp |
| asin, acos | abs(x) <= 1 | 2.0 ulp |
| exp | all; below 1e-308, half the smallest number | 1.0 ulp |
| log | x >= 0 | 1.0 ulp |
| sinc_sqrt | 0 <= s <= 6; beyond, 2e-16 | 2.5 ulp |
| sinc_sqrt_slope | 0 <= s <= 10; beyond, 1e-17 | 2.5 ulp |
| cos_sqrt | 0 <= s <= 1; beyond, 2e-16 for a few turns | 1.5 ulp |
| angle_ratio | s >= 0, any z, but s = 0 and z <= 0, which gives not a number | 3.0 ulp |
| angle_ratio_slope | the same | 8.0 ulp |
| axial_sum | s >= 0, any z | 2.5 ulp |
| normalised_ratio, its slope | all | 1.5 ulp |

The polynomials are those of the public fdlibm (Sun Microsystems, 1993); reductions follow Cody and Waite.
The digest of a kernel's machine code covers the functions that it calls.
"""

import math
from math import sqrt
from typing import Any

import numpy as np

from obseq.compilation import Instruction, compiled
from obseq.compilation.digests import CONTRACT

__all__ = [
    "acos",
    "angle_ratio",
    "angle_ratio_slope",
    "asin",
    "atan",
    "atan2",
    "axial_sum",
    "cos",
    "cos_sqrt",
    "exp",
    "keep_loop",
    "log",
    "normalised_ratio",
    "normalised_ratio_slope",
    "sin",
    "sinc_sqrt",
    "sinc_sqrt_slope",
    "sqrt",
    "tan",
    "wrap_angle",
]

inline: Any = compiled(flags=CONTRACT, always_inline=True)
keep_loop = Instruction("obseq.kernels.instructions", "keep_loop")
_bits = Instruction("obseq.kernels.instructions", "bits_of")
_float = Instruction("obseq.kernels.instructions", "float_of")

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

LOG2_E = 1.44269504088896338700
LN_2, LN_2_TAIL = 6.93147180369123816490e-01, 1.90821492927058770002e-10
E1, E2, E3 = 1.66666666666666019037e-01, -2.77777777770155933842e-03, 6.61375632143793436117e-05
E4, E5 = -1.65339022054652515390e-06, 4.13813679705723846039e-08
L1, L2, L3 = 6.666666666666735130e-01, 3.999999999940941908e-01, 2.857142874366239149e-01
L4, L5, L6 = 2.222219843214978396e-01, 1.818357216161805012e-01, 1.531383769920937332e-01
L7 = 1.479819860511658591e-01
SMALLEST_NORMAL = 2.2250738585072014e-308
TWO_54 = 18014398509481984.0

SHIFT = np.uint64(52)
ONE_BITS = np.uint64(0x3FF0000000000000)
MANTISSA_BITS = np.uint64(0x000FFFFFFFFFFFFF)
SQRT_HALF_BITS = np.uint64(0x3FE6A09E667F3BCD)
WHOLE_BITS = np.uint64(0x4330000000000000)
BIAS = 4503599627370496.0 + 1023.0
"""2^52, whose bits are WHOLE_BITS, plus the bias of exponents."""
WHOLE = 6755399441055744.0
"""1.5 times 2^52: the last bits of x + WHOLE are those of the whole number x."""

ALTERNATING = 12
SINC_SLOPE = tuple((-1) ** k * k / math.factorial(2 * k + 1) for k in range(1, ALTERNATING + 1))
"""Taylor coefficients of the derivative of sin(sqrt(s))/sqrt(s)."""

SEGMENT = tuple((-1) ** (k + 1) * 4**k / math.factorial(2 * k + 1) for k in range(1, ALTERNATING + 3))
"""Taylor coefficients in t^2 of (t - sin t cos t)/t^3."""


@inline
def _reduce(x):
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
def _sine(x, tail):
    """Sine on [-pi/4, pi/4]."""
    z = x * x
    v = z * x
    r = S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)))
    return x - ((z * (0.5 * tail - v * r) - tail) - v * S1)


@inline
def _cosine(x, tail):
    """Cosine on [-pi/4, pi/4]."""
    z = x * x
    r = z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))))
    half = 0.5 * z
    w = 1.0 - half
    return w + (((1.0 - w) - half) + (z * r - x * tail))


@inline
def _select(quadrant, x, tail):
    """Sine of quadrant pi/2 + x, for a quadrant that is a whole float."""
    turn = quadrant - 4.0 * np.floor(0.25 * quadrant)
    sine, cosine = _sine(x, tail), _cosine(x, tail)
    value = sine if turn == 0.0 or turn == 2.0 else cosine
    return -value if turn >= 2.0 else value


@inline
def sin(x):
    """Sine of x radians."""
    quadrant, remainder, tail = _reduce(x)
    value = _select(quadrant, remainder, tail)
    return value if abs(x) <= LARGEST_ANGLE else math.nan


@inline
def cos(x):
    """Cosine of x radians."""
    quadrant, remainder, tail = _reduce(x)
    value = _select(quadrant + 1.0, remainder, tail)
    return value if abs(x) <= LARGEST_ANGLE else math.nan


@inline
def _arc_tangent(t):
    """What t exceeds its arc tangent by, for abs(t) <= tan(pi/8)."""
    z = t * t
    w = z * z
    even = z * (A0 + w * (A2 + w * (A4 + w * (A6 + w * (A8 + w * A10)))))
    odd = w * (A1 + w * (A3 + w * (A5 + w * (A7 + w * A9))))
    return t * (even + odd)


@inline
def atan2(y, x):
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
def asin(x):
    """Arc sine of x in radians; not a number beyond [-1, 1]."""
    return atan2(x, sqrt((1.0 - x) * (1.0 + x)))


@inline
def acos(x):
    """Arc cosine of x in radians; not a number beyond [-1, 1]."""
    return atan2(sqrt((1.0 - x) * (1.0 + x)), x)


@inline
def atan(x):
    """Arc tangent of x in radians."""
    return atan2(x, 1.0)


@inline
def tan(x):
    """Tangent of x radians."""
    quadrant, remainder, tail = _reduce(x)
    sine, cosine = _sine(remainder, tail), _cosine(remainder, tail)
    odd = quadrant != 2.0 * np.floor(0.5 * quadrant)
    value = (-cosine if odd else sine) / (sine if odd else cosine)
    return value if abs(x) <= LARGEST_ANGLE else math.nan


@inline
def _two_to(whole):
    """2^whole, for a whole float in [-1022, 1023]."""
    return _float((_bits(whole + WHOLE) << SHIFT) + ONE_BITS)


@inline
def exp(x):
    """Exponential of x."""
    x = 710.0 if x > 710.0 else x
    x = -746.0 if x < -746.0 else x
    whole = np.rint(x * LOG2_E)
    high, low = x - whole * LN_2, whole * LN_2_TAIL
    r = high - low
    t = r * r
    c = r - t * (E1 + t * (E2 + t * (E3 + t * (E4 + t * E5))))
    y = 1.0 - ((low - (r * c) / (2.0 - c)) - high)
    half = np.rint(0.5 * whole)
    return y * _two_to(half) * _two_to(whole - half)


@inline
def log(x):
    """Natural logarithm of x; minus infinity at 0, not a number below."""
    subnormal = x < SMALLEST_NORMAL
    bits = _bits(x * TWO_54 if subnormal else x) + (ONE_BITS - SQRT_HALF_BITS)
    whole = _float((bits >> SHIFT) | WHOLE_BITS) - (BIAS + 54.0 if subnormal else BIAS)
    f = _float((bits & MANTISSA_BITS) + SQRT_HALF_BITS) - 1.0
    s = f / (2.0 + f)
    z = s * s
    r = z * (L1 + z * (L2 + z * (L3 + z * (L4 + z * (L5 + z * (L6 + z * L7))))))
    half = 0.5 * f * f
    value = whole * LN_2 - ((half - (s * (half + r) + whole * LN_2_TAIL)) - f)
    value = value if x < math.inf else x
    return value if x > 0.0 else (-math.inf if x == 0.0 else math.nan)


@inline
def sinc_sqrt(s):
    """sin(r)/r for r = sqrt(s)."""
    root = sqrt(s)
    return sin(root) / root if s != 0.0 else 1.0


@inline
def sinc_sqrt_slope(s):
    """Derivative of sin(r)/r with respect to s = r^2."""
    near = s < 2.5
    t = s if near else 0.0
    a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12 = SINC_SLOPE
    series = a7 + t * (a8 + t * (a9 + t * (a10 + t * (a11 + t * a12))))
    series = a1 + t * (a2 + t * (a3 + t * (a4 + t * (a5 + t * (a6 + t * series)))))
    far = 2.5 if near else s
    root = sqrt(far)
    return series if near else 0.5 * (cos(root) - sin(root) / root) / far


@inline
def cos_sqrt(s):
    """cos(r) for r = sqrt(s)."""
    return cos(sqrt(s))


@inline
def angle_ratio(s, z):
    """atan2(r, z)/r for r = sqrt(s); 1/z for r = 0 and z > 0, not a number for r = 0 and z <= 0."""
    root = sqrt(s)
    on_axis = s == 0.0
    numerator = (1.0 if z > 0.0 else math.nan) if on_axis else atan2(root, z)
    return numerator / (z if on_axis else root)


@inline
def angle_ratio_slope(ratio, s, z):
    """Derivative of `angle_ratio` with respect to s, from its value.

    With the angle t = r ratio it is (sin t cos t - t)/(2 r^3) = -ratio^3 (t - sin t cos t)/(2 t^3), and the
    last quotient is a smooth function of t^2.
    """
    square = ratio * ratio * s
    near = square < 1.0
    t = square if near else 0.0
    a1, a2, a3, a4, a5, a6, a7, a8, a9, a10, a11, a12, a13, a14 = SEGMENT
    series = a7 + t * (a8 + t * (a9 + t * (a10 + t * (a11 + t * (a12 + t * (a13 + t * a14))))))
    series = a1 + t * (a2 + t * (a3 + t * (a4 + t * (a5 + t * (a6 + t * series)))))
    smooth = -0.5 * ratio * ratio * ratio * series
    return smooth if near else (z / (s + z * z) - ratio) / (2.0 * s)


@inline
def axial_sum(s, z):
    """sqrt(s + z^2) + z, without cancellation for z < 0."""
    larger = sqrt(s + z * z) + abs(z)
    return larger if z >= 0.0 else s / larger


@inline
def normalised_ratio(first, second):
    """(a - b)/max(a, b) of two values, negative ones taken as 0; 0 when both are."""
    a, b = (first if first > 0.0 else 0.0 * first), (second if second > 0.0 else 0.0 * second)
    largest = a if a > b else b
    return (a - b) / (largest if largest > 0.0 else 1.0)


@inline
def normalised_ratio_slope(first, second):
    """Derivative of `normalised_ratio` with respect to its first argument; 0 where that is negative."""
    b = second if second > 0.0 else 0.0 * second
    steep = first < b
    largest = b if steep else first
    active = first >= 0.0 and largest > 0.0
    value = (1.0 if steep else b / (largest if active else 1.0)) / (largest if active else 1.0)
    return value if active else 0.0 * (first + second)


@inline
def wrap_angle(angle):
    """An angle brought to (-pi, pi] by whole turns."""
    return angle - (2.0 * PI) * np.ceil((angle - PI) * (0.5 / PI))

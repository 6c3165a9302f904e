"""C texts of the operators that are not in math.h, each under a guard so that headers can be combined."""

import math
from collections.abc import Sequence

WORDS = (
    *(
        "auto",
        "break",
        "case",
        "char",
        "const",
        "continue",
        "default",
        "do",
        "double",
        "else",
        "enum",
        "extern",
    ),
    *(
        "float",
        "for",
        "goto",
        "if",
        "inline",
        "int",
        "long",
        "register",
        "restrict",
        "return",
        "short",
        "signed",
    ),
    *("sizeof", "static", "struct", "switch", "typedef", "union", "unsigned", "void", "volatile", "while"),
    *("unknowns", "observations", "residuals", "jacobian"),
)
"""Words that no variable of a C function may take."""


def _helper(name: str, arguments: Sequence[str], body: str) -> str:
    guard = f"OBSEQ_HAS_{name.upper()}"
    parameters = ", ".join(f"double {argument}" for argument in arguments)
    lines = "\n".join(f"    {line}" for line in body.strip().splitlines())
    text = f"static inline double obseq_{name}({parameters})\n{{\n{lines}\n}}"
    return f"#ifndef {guard}\n#define {guard}\n{text}\n#endif"


def _polynomial(coefficients: Sequence[float], variable: str) -> str:
    text = repr(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        text = f"{coefficient!r} + {variable} * ({text})"
    return text


SINC_SLOPE = [(-1) ** k * k / math.factorial(2 * k + 1) for k in range(1, 13)]
"""Derivative of sin(r)/r by r^2, as a series in r^2."""

SEGMENT = [(-1) ** k * 2 ** (2 * k + 2) / math.factorial(2 * k + 3) for k in range(14)]
"""(t - sin t cos t)/t^3, as a series in t^2."""

HELPERS: dict[str, str] = {
    **dict.fromkeys(("sqrt", "sin", "cos", "tan", "exp", "log", "asin", "acos", "atan", "atan2"), ""),
    "wrap_angle": _helper(
        "wrap_angle",
        ["angle"],
        "return angle - 6.283185307179586 * ceil((angle - 3.141592653589793) * 0.15915494309189535);",
    ),
    "sinc_sqrt": _helper("sinc_sqrt", ["s"], "return s != 0.0 ? sin(sqrt(s)) / sqrt(s) : 1.0;"),
    "sinc_sqrt_slope": _helper(
        "sinc_sqrt_slope",
        ["s"],
        f"""if (s < 2.5)
    return {_polynomial(SINC_SLOPE, "s")};
return 0.5 * (cos(sqrt(s)) - sin(sqrt(s)) / sqrt(s)) / s;""",
    ),
    "cos_sqrt": _helper("cos_sqrt", ["s"], "return cos(sqrt(s));"),
    "angle_ratio": _helper(
        "angle_ratio",
        ["s", "z"],
        """if (s == 0.0)
    return z > 0.0 ? 1.0 / z : NAN;
return atan2(sqrt(s), z) / sqrt(s);""",
    ),
    "angle_ratio_slope": _helper(
        "angle_ratio_slope",
        ["ratio", "s", "z"],
        f"""const double t = ratio * ratio * s;
if (t < 1.0)
    return -0.5 * ratio * ratio * ratio * ({_polynomial(SEGMENT, "t")});
return (z / (s + z * z) - ratio) / (2.0 * s);""",
    ),
    "axial_sum": _helper(
        "axial_sum",
        ["s", "z"],
        """const double larger = sqrt(s + z * z) + fabs(z);
return z >= 0.0 ? larger : s / larger;""",
    ),
    "normalised_ratio": _helper(
        "normalised_ratio",
        ["first", "second"],
        """const double a = first > 0.0 ? first : 0.0 * first;
const double b = second > 0.0 ? second : 0.0 * second;
const double largest = a > b ? a : b;
return (a - b) / (largest > 0.0 ? largest : 1.0);""",
    ),
    "normalised_ratio_slope": _helper(
        "normalised_ratio_slope",
        ["first", "second"],
        """const double b = second > 0.0 ? second : 0.0 * second;
const double largest = first < b ? b : first;
if (!(first >= 0.0 && largest > 0.0))
    return 0.0 * (first + second);
return (first < b ? 1.0 : b / largest) / largest;""",
    ),
}
"""What a kernel function is in C: empty when math.h has it, else the text of a helper."""

"""C text: words that no name may take, and functions under a guard so that headers can be combined."""

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


def helper(name: str, arguments: Sequence[str], body: str) -> str:
    """The C function `obseq_NAME` of some numbers, with its guard."""
    guard = f"OBSEQ_HAS_{name.upper()}"
    parameters = ", ".join(f"double {argument}" for argument in arguments)
    lines = "\n".join(f"    {line}" for line in body.strip().splitlines())
    text = f"static inline double obseq_{name}({parameters})\n{{\n{lines}\n}}"
    return f"#ifndef {guard}\n#define {guard}\n{text}\n#endif"


def polynomial(coefficients: Sequence[float], variable: str) -> str:
    """A polynomial of a variable by Horner's rule, the constant first."""
    text = repr(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        text = f"{coefficient!r} + {variable} * ({text})"
    return text

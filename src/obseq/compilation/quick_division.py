"""Divisions and square roots of vectors of 512 bits, in the text of LLVM, by rough values that are refined.

A processor divides eight numbers in 16 cycles and takes eight roots in 24, one after the other; it has 14
bits of a reciprocal or of the reciprocal of a root in a few, and Newton's steps to 53 bits are products, of
which it does two vectors a cycle. A loop of little else than divisions is nearly twice as fast so; one that
has enough else to do meanwhile is left as it is.

The last step is a correction by the exact remainder, as P. Markstein describes it (Computation of elementary
functions on the IBM RISC System/6000 processor, 1990): results are those of the processor's own division
but for one reciprocal in a thousand, whose last bit differs. Zeros, infinities and what is not a number give
what they give elsewhere, but for the root of infinity, which is not a number.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import llvmlite.binding as llvm

if TYPE_CHECKING:
    from obseq.compilation.emission import Value

DIVISION, ROOT = 16, 24
"""Cycles of a processor for eight divisions, and for eight square roots."""

LEAST_RATIO = 1.5
"""Cycles of divisions and roots for one other operation, from which a loop waits for them alone."""

VECTOR = "<8 x double>"
OPERAND = r"(%[\w.]+|splat \([^)]*\))"
ONE = r"splat \(double 1\.0+e\+00\)"
FLAGS = r"(?:\w+ )*"

RECIPROCALS = re.compile(rf"fdiv {FLAGS}{VECTOR} {ONE}, {OPERAND}")
QUOTIENTS = re.compile(rf"fdiv {FLAGS}{VECTOR} {OPERAND}, {OPERAND}")
ROOTS = re.compile(rf"call {FLAGS}{VECTOR} @llvm\.sqrt\.v8f64\({VECTOR} {OPERAND}\)")
OTHERS = re.compile(rf"= f(?:add|sub|mul) {FLAGS}{VECTOR}")
BLOCK = re.compile(r"^(?=[\w.\"]+:)", re.MULTILINE)

PROBE = f"define {VECTOR} @probe({VECTOR} %a) {{ %b = fadd {VECTOR} %a, %a ret {VECTOR} %b }}"


def _eight(value: str) -> str:
    """A vector of one number."""
    return "<" + ", ".join([f"double {value}"] * 8) + ">"


_REFINED_RECIPROCAL = """
  %seed = call V @llvm.x86.avx512.rcp14.pd.512(V %b, V zeroinitializer, i8 -1)
  %minus_b = fneg V %b
  %error_0 = call V @llvm.fma.v8f64(V %minus_b, V %seed, V ONE)
  %half = call V @llvm.fma.v8f64(V %seed, V %error_0, V %seed)
  %error_1 = call V @llvm.fma.v8f64(V %minus_b, V %half, V ONE)
  %inverse = call V @llvm.fma.v8f64(V %half, V %error_1, V %half)
"""

FUNCTIONS = (
    """
declare V @llvm.x86.avx512.rcp14.pd.512(V, V, i8)
declare V @llvm.x86.avx512.rsqrt14.pd.512(V, V, i8)
declare V @llvm.fma.v8f64(V, V, V)

define internal V @obseq.reciprocal(V %b) alwaysinline {REFINED
  %is_odd = fcmp uno V %inverse, zeroinitializer
  %result = select <8 x i1> %is_odd, V %seed, V %inverse
  ret V %result
}

define internal V @obseq.quotient(V %a, V %b) alwaysinline {REFINED
  %close = fmul V %a, %inverse
  %remainder = call V @llvm.fma.v8f64(V %minus_b, V %close, V %a)
  %quotient = call V @llvm.fma.v8f64(V %remainder, V %inverse, V %close)
  %is_odd = fcmp uno V %quotient, zeroinitializer
  %rough = fmul V %a, %seed
  %result = select <8 x i1> %is_odd, V %rough, V %quotient
  ret V %result
}

define internal V @obseq.root(V %given) alwaysinline {
  %x = fadd V %given, zeroinitializer
  %seed = call V @llvm.x86.avx512.rsqrt14.pd.512(V %x, V zeroinitializer, i8 -1)
  %is_beyond = fcmp ogt V %seed, LARGEST
  %rough = select <8 x i1> %is_beyond, V LARGEST, V %seed
  %product = fmul V %x, %rough
  %minus_product = fneg V %product
  %error = call V @llvm.fma.v8f64(V %minus_product, V %rough, V ONE)
  %factor = call V @llvm.fma.v8f64(V %error, V THREE_EIGHTHS, V HALF)
  %change = fmul V %rough, %error
  %inverse = call V @llvm.fma.v8f64(V %change, V %factor, V %rough)
  %close = fmul V %x, %inverse
  %minus_close = fneg V %close
  %remainder = call V @llvm.fma.v8f64(V %minus_close, V %close, V %x)
  %half_inverse = fmul V %inverse, HALF
  %result = call V @llvm.fma.v8f64(V %remainder, V %half_inverse, V %close)
  ret V %result
}
""".replace("REFINED", _REFINED_RECIPROCAL)
    .replace("ONE", _eight("1.0"))
    .replace("THREE_EIGHTHS", _eight("0.375"))
    .replace("HALF", _eight("0.5"))
    .replace("LARGEST", _eight("1.0e200"))
    .replace("V ", f"{VECTOR} ")
    .replace("V,", f"{VECTOR},")
    .replace("V)", f"{VECTOR})")
)
"""Reciprocal, quotient and root of eight numbers; `LARGEST`, and 0 added to -0, give the root of 0."""


def has_wide_vectors(machine: Value) -> bool:
    """Whether a target computes with vectors of 512 bits: it says so by its code for one of them."""
    return "zmm" in str(machine.emit_assembly(llvm.parse_assembly(PROBE)))


def quickened(text: str) -> str | None:
    """A module's text with the divisions and roots refined of loops that wait for them; None without any."""
    blocks = BLOCK.split(text)
    changed = [_refined(block) if _waits(block) else block for block in blocks]
    return None if changed == blocks else "".join(changed) + FUNCTIONS


def _waits(block: str) -> bool:
    """Whether a block waits for divisions and roots, not for its other arithmetic."""
    cycles = DIVISION * len(QUOTIENTS.findall(block)) + ROOT * len(ROOTS.findall(block))
    return cycles > LEAST_RATIO * len(OTHERS.findall(block))


def _refined(block: str) -> str:
    block = RECIPROCALS.sub(rf"call {VECTOR} @obseq.reciprocal({VECTOR} \1)", block)
    block = QUOTIENTS.sub(rf"call {VECTOR} @obseq.quotient({VECTOR} \1, {VECTOR} \2)", block)
    return ROOTS.sub(rf"call {VECTOR} @obseq.root({VECTOR} \1)", block)

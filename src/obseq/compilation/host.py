"""This process: the processor, and compiled code put to work in memory. Only here llvmlite runs code."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import llvmlite.binding as llvm

from obseq.compilation import objects

if TYPE_CHECKING:
    from obseq.compilation.emission import Value


def description() -> str:
    """System, kind of processor and its features: compiled code runs where they are the same."""
    return " ".join((llvm.get_process_triple(), *_processor()))


@cache
def _processor() -> tuple[str, str]:
    """What code is compiled for: a kind of processor and further features, as LLVM writes them.

    The kind is the one that libraries compiled ahead of time are made for, if there is one: LLVM orders sums
    otherwise for each make of processor, and results are the same to the last digit only with one choice.
    """
    if kinds := objects.levels_here():
        return kinds[0], ""
    return llvm.get_host_cpu_name(), str(llvm.get_host_cpu_features().flatten())


WIDE = "-prefer-256-bit"
"""Takes back LLVM's reserve against vectors of 512 bits, on processors that have them; others ignore it."""


def machine(wide: bool = False) -> Value:
    """The target of code that is put to work in this process; `wide` with the widest vectors there are."""
    _initialise()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    model = "static" if target.name.startswith("x86") else "default"
    options = {"reloc": model, "codemodel": "jitdefault", "jit": True}
    processor, features = _processor()
    wanted = _preferring(features, target, wide)
    return target.create_target_machine(processor, wanted, opt=3, **options)


def other_machine(processor: str, wide: bool = False) -> Value:
    """The target of code for a kind of processor, to be linked in a library."""
    _initialise()
    target = llvm.Target.from_triple(llvm.get_process_triple())
    wanted = _preferring("", target, wide)
    return target.create_target_machine(processor, wanted, opt=3, reloc="pic", codemodel="default")


def _preferring(usual: str, target: Value, wide: bool) -> str:
    """Features of a target, the preference for the widest vectors among them."""
    return ",".join(filter(None, (usual, WIDE if wide and target.name.startswith("x86") else "")))


def load(code: bytes, symbol: str) -> int:
    """Puts an object file in memory; the address of one of its functions."""
    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    address = int(engine.get_function_address(symbol))
    if not address:
        raise RuntimeError(f"{symbol} is not in its object file")
    return address


@cache
def _engine() -> Value:
    """The engine that keeps all loaded code until the end of the process."""
    module = llvm.parse_assembly("")
    module.triple = llvm.get_process_triple()
    return llvm.create_mcjit_compiler(module, machine())


@cache
def _initialise() -> None:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()

"""From functions to machine code by numba, which is imported here: not before something is compiled.

Numba gives the types and LLVM's text of a function and of all that it calls; they are put in one module,
optimised once, together, and written as one object file that needs nothing of numba to run.
"""

from __future__ import annotations

import importlib
from functools import cache
from types import FunctionType
from typing import TYPE_CHECKING

import llvmlite.binding as llvm
from llvmlite import ir
from numba import njit, types
from numba.core import codegen, compiler
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import cpu_target

from obseq.compilation import host
from obseq.compilation.digests import Function, Instruction, named_values
from obseq.compilation.settings import FAILED, OBJECT_HEADER, TYPE_NUMBERS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from obseq.compilation.emission import Builder, Context, NumbaType, Value
    from obseq.compilation.signatures import Argument, Parameter, Signature

OPTIONS = {"error_model": "numpy", "no_cpython_wrapper": True, "no_cfunc_wrapper": True, "_nrt": False}
INT = ir.IntType(64)
BYTE = ir.IntType(8)
POINTER = BYTE.as_pointer()

DATA, DIMENSIONS, SHAPE, TYPE, FLAGS = (OBJECT_HEADER + offset for offset in (0, 8, 16, 40, 48))
"""Where the fields of an array are, as in `PyArrayObject_fields` of NumPy's interface for compiled code."""

KIND = OBJECT_HEADER - 8
"""Where an object says its type."""

BYTE_ORDER, TYPE_NUMBER = OBJECT_HEADER + 10, OBJECT_HEADER + 12
"""Where a type of entries says its byte order and its number, as in `PyArray_Descr`."""

WANTED_FLAGS, WRITEABLE = 0x101, 0x400
"""C-contiguous and aligned."""

COUNT = OBJECT_HEADER - 16
"""Where an object counts who refers to it."""


WIDEST_VECTOR = 64
"""Bytes to which the stack of a function is aligned: each vector kept there lies in one line of the cache.
LLVM does not do that by itself, and kernels with many such vectors took a quarter longer."""

KERNEL_EFFORT, LOOP_EFFORT = 3, 2
"""Levels of optimisation: loops are as fast with the lower one, and not unrolled, and compiled in a third of
the time."""


class _Library(codegen.AOTCodeLibrary):  # type: ignore[misc]
    """Text that is gathered, not optimised on the way."""

    def _optimize_functions(self, module: Value) -> None:
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def get_pointer_to_function(self, name: str) -> int:
        """No address: nothing is run before the whole is compiled."""
        return 0


class _Codegen(codegen.AOTCPUCodegen):  # type: ignore[misc]
    _library_class = _Library

    def set_env(self, name: str, environment: Value) -> None:
        """No environment: compiled loops never call Python."""


@cache
def _codegen() -> _Codegen:
    return _Codegen("obseq")


def compile_for_here(function: Function, signature: Signature, symbol: str) -> bytes:
    """Object file of a function for this processor, to be loaded by `host.load`."""
    machine = host.machine(signature.wide)
    return bytes(machine.emit_object(optimised(function, signature, symbol, machine)))


def compile_for(
    function: Function, signature: Signature, symbol: str, processors: Sequence[str]
) -> dict[str, bytes]:
    """Object files of a function for kinds of processors, as LLVM calls them, to be linked in libraries."""
    text, found = str(assembled(function, signature, symbol)), {}
    for processor in processors:
        machine = host.other_machine(processor, signature.wide)
        module = optimise(llvm.parse_assembly(text), machine, symbol, signature)
        found[processor] = bytes(machine.emit_object(module))
    return found


def optimised(function: Function, signature: Signature, symbol: str, machine: Value) -> Value:
    """LLVM's module of a function for a machine, ready to be written as an object file."""
    return optimise(assembled(function, signature, symbol), machine, symbol, signature)


def assembled(function: Function, signature: Signature, symbol: str) -> Value:
    """LLVM's module of a function and all that it calls, as numba writes it; the entry is the symbol."""
    with global_compiler_lock:
        context = cpu_target.target_context
        usual, context._internal_codegen = context._internal_codegen, _codegen()
        try:
            library, description = _compiled(function, signature, context)
            library.add_ir_module(_entry(signature, symbol, context, library, description))
            library.finalize()
        finally:
            context._internal_codegen = usual
        return library._final_module


def optimise(module: Value, machine: Value, symbol: str, signature: Signature) -> Value:
    """A module optimised as a whole; all but the symbol may vanish in what calls it."""
    for function in module.functions:
        if not function.is_declaration and function.name != symbol:
            function.linkage = "internal"
    _run_passes(module, machine, KERNEL_EFFORT if is_kernel(signature) else LOOP_EFFORT)
    return module


def _run_passes(module: Value, machine: Value, effort: int) -> None:
    options = llvm.create_pipeline_tuning_options(effort)
    options.loop_vectorization = options.slp_vectorization = True
    options.loop_unrolling = effort == KERNEL_EFFORT
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(module, builder)


def _compiled(function: Function, signature: Signature, context: Context) -> tuple[Value, Value]:
    """Numba's library of a function, and its description."""
    flags = compiler.Flags()
    cpu_target.options.parse_as_flags(flags, _options(function))
    flags.no_compile = True
    result = compiler.compile_extra(
        cpu_target.typing_context,
        context,
        _translated(function),
        [_argument_type(argument) for argument in signature.arguments],
        _number(signature.result),
        flags,
        {},
    )
    return result.library, result.fndesc


def _options(function: Function) -> dict[str, object]:
    options: dict[str, object] = dict(OPTIONS)
    if function.flags:
        options["fastmath"] = set(function.flags)
    if function.always_inline:
        options["forceinline"] = True
    return options


@cache
def dispatcher(function: Function) -> Value:
    """A function as numba's own compiled functions call it."""
    return njit(**_options(function))(_translated(function))


def _translated(function: Function) -> FunctionType:
    """The plain function, with what it names in numba's terms."""
    python = function.python
    names = dict(python.__globals__)
    for name, value in named_values(python):
        if isinstance(value, Function):
            names[name] = dispatcher(value)
        elif isinstance(value, Instruction):
            names[name] = getattr(importlib.import_module(value.module), value.name)
    return FunctionType(python.__code__, names, python.__name__, python.__defaults__, python.__closure__)


def _argument_type(argument: Argument) -> Value:
    members = [_type(parameter) for parameter in argument.parameters]
    return types.NamedTuple(members, argument.record) if argument.record else members[0]


def _type(parameter: Parameter) -> Value:
    number = _number(parameter.type)
    if parameter.dimensions < 0:
        return types.CPointer(number)
    return types.Array(number, parameter.dimensions, "C") if parameter.dimensions else number


def _number(name: str | None) -> Value:
    return types.boolean if name == "bool" else getattr(types, name or "void")


def _entry(signature: Signature, symbol: str, context: Context, library: Value, description: Value) -> Value:
    """What is called from outside: plain C for kernels, Python's arrays unpacked for loops."""
    module = library.create_ir_module(f"entry of {symbol}")
    module.data_layout = _codegen()._data_layout
    emit = _quick_entry if signature.at_once else _kernel_entry if is_kernel(signature) else _loop_entry
    emit(symbol, signature, context, module, description)
    for function in module.functions:
        if function.blocks:
            function.attributes.add("nounwind")
            function.attributes.alignstack = WIDEST_VECTOR
    return module


def is_kernel(signature: Signature) -> bool:
    """Whether a function is a generated kernel, called in plain C."""
    return any(parameter.dimensions < 0 for parameter in signature.parameters)


def _kernel_entry(
    symbol: str, signature: Signature, context: Context, module: Value, description: Value
) -> None:
    entry = ir.Function(module, ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer(), INT]), symbol)
    builder = ir.IRBuilder(entry.append_basic_block())
    _call(context, module, builder, description, list(entry.args))
    builder.ret_void()


def _quick_entry(
    symbol: str, signature: Signature, context: Context, module: Value, description: Value
) -> None:
    """A builtin of Python's: its object, the type of arrays; where its arguments are; their number.

    It returns the last argument, if all are as they must be and the function returned 0; else the first.
    """
    checked = f"{symbol}_checked"
    _loop_entry(checked, signature, context, module, description)
    entry = ir.Function(module, ir.FunctionType(POINTER, [POINTER, POINTER.as_pointer(), INT]), symbol)
    builder = ir.IRBuilder(entry.append_basic_block())
    array_type, given, number = entry.args
    wanted = len(signature.parameters)
    with builder.if_then(builder.icmp_unsigned("!=", number, INT(wanted)), likely=False):
        builder.ret(POINTER(None))
    values = [builder.load(builder.gep(given, [INT(k)])) for k in range(wanted)]
    result = builder.alloca(INT)
    builder.store(INT(0), result)
    place = builder.bitcast(result, POINTER)
    status = builder.call(module.get_global(checked), [place, array_type, *values])
    refused = builder.icmp_unsigned("!=", builder.or_(status, builder.load(result)), INT(0))
    returned = builder.select(refused, values[0], values[-1])
    count = builder.bitcast(builder.gep(returned, [INT(COUNT)]), INT.as_pointer())
    builder.store(builder.add(builder.load(count), INT(1)), count)
    builder.ret(returned)


def _loop_entry(
    symbol: str, signature: Signature, context: Context, module: Value, description: Value
) -> None:
    """Arguments: where the result goes, the type of arrays, then numbers and Python's arrays."""
    kinds = [_passed(parameter) for parameter in signature.parameters]
    entry = ir.Function(module, ir.FunctionType(INT, [POINTER, POINTER, *kinds]), symbol)
    builder = ir.IRBuilder(entry.append_basic_block())
    place, array_type, *given = entry.args
    for number, (parameter, value) in enumerate(zip(signature.parameters, given, strict=True), 1):
        if parameter.dimensions:
            flags = WANTED_FLAGS | WRITEABLE * signature.at_once
            _check(builder, parameter, value, array_type, flags, number)
    members = iter(
        _value(context, builder, parameter, value)
        for parameter, value in zip(signature.parameters, given, strict=True)
    )
    values = []
    for argument in signature.arguments:
        parts = [next(members) for _ in argument.parameters]
        kind = _argument_type(argument)
        values.append(context.make_tuple(builder, kind, parts) if argument.record else parts[0])
    status, result = _call(context, module, builder, description, values)
    with builder.if_then(status.is_error, likely=False):
        builder.ret(INT(FAILED))
    if signature.result is not None:
        builder.store(result, builder.bitcast(place, result.type.as_pointer()))
    builder.ret(INT(0))


def _passed(parameter: Parameter) -> Value:
    if parameter.dimensions:
        return POINTER
    return ir.DoubleType() if parameter.type == "float64" else INT


def _check(
    builder: Builder, parameter: Parameter, value: Value, array_type: Value, wanted_flags: int, number: int
) -> None:
    """Gives up with the number of the parameter unless it is an array of the type and shape wanted."""

    def refuse_unless(condition: Value) -> None:
        with builder.if_then(builder.not_(condition), likely=False):
            builder.ret(INT(number))

    refuse_unless(builder.icmp_unsigned("==", _field(builder, value, KIND, POINTER), array_type))
    flags = _field(builder, value, FLAGS, ir.IntType(32))
    wanted = ir.Constant(ir.IntType(32), wanted_flags)
    refuse_unless(builder.icmp_unsigned("==", builder.and_(flags, wanted), wanted))
    dimensions = _field(builder, value, DIMENSIONS, ir.IntType(32))
    refuse_unless(builder.icmp_unsigned("==", dimensions, ir.Constant(ir.IntType(32), parameter.dimensions)))
    kind = _field(builder, value, TYPE, POINTER)
    found = _field(builder, kind, TYPE_NUMBER, ir.IntType(32))
    wanted = ir.Constant(ir.IntType(32), TYPE_NUMBERS[parameter.type])
    refuse_unless(builder.icmp_unsigned("==", found, wanted))
    order = _field(builder, kind, BYTE_ORDER, BYTE)
    refuse_unless(builder.icmp_unsigned("!=", order, BYTE(ord(">"))))


def _field(builder: Builder, record: Value, offset: int, kind: NumbaType) -> Value:
    place = builder.gep(record, [INT(offset)])
    return builder.load(builder.bitcast(place, kind.as_pointer()))


def _value(context: Context, builder: Builder, parameter: Parameter, value: Value) -> Value:
    """A number or an array as numba passes it."""
    kind = _type(parameter)
    if not parameter.dimensions:
        return builder.icmp_signed("!=", value, INT(0)) if parameter.type == "bool" else value
    array = context.make_array(kind)(context, builder)
    entry = context.get_data_type(kind.dtype)
    size = context.get_abi_sizeof(entry)
    shape_at = _field(builder, value, SHAPE, INT.as_pointer())
    shape = [builder.load(builder.gep(shape_at, [INT(k)])) for k in range(kind.ndim)]
    strides = [INT(size)]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    context.populate_array(
        array,
        data=_field(builder, value, DATA, entry.as_pointer()),
        shape=shape,
        strides=strides,
        itemsize=INT(size),
        meminfo=None,
    )
    return array._getvalue()


def _call(
    context: Context, module: Value, builder: Builder, description: Value, values: list[Value]
) -> Value:
    """Calls the function that numba compiled; its status and its result."""
    function = context.declare_function(module, description)
    return context.call_conv.call_function(
        builder, function, description.restype, description.argtypes, values
    )

"""Calls of Fortran routines in LLVM's own terms; imported when something is compiled."""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from obseq.compilation.emission import Builder, Context, Emitter, NumbaType, Value


def _called(
    context: Context, builder: Builder, kinds: NumbaType, values: Value, more: tuple[Value, ...] = ()
) -> None:
    """Calls the routine at the first value with the members of the second, by reference but for addresses."""
    pointers = []
    for position, kind in enumerate(kinds):
        value = builder.extract_value(values[1], position)
        if kind == types.int64:
            pointers.append(builder.inttoptr(value, cgutils.voidptr_t))
        else:
            slot = cgutils.alloca_once_value(builder, value)
            pointers.append(builder.bitcast(slot, cgutils.voidptr_t))
    pointers.extend(more)
    function_type = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t] * len(pointers))
    builder.call(builder.inttoptr(values[0], function_type.as_pointer()), pointers)


@intrinsic
def fortran(typing_context: Context, address: NumbaType, arguments: NumbaType) -> Emitter:
    """Calls a Fortran routine; uint8, int32 and float64 go by reference, int64 are addresses."""

    def generate(context: Context, builder: Builder, signature: NumbaType, values: Value) -> Value:
        _called(context, builder, signature.args[1].types, values)
        return context.get_dummy_value()

    return types.void(types.int64, arguments), generate


@intrinsic
def lapack(typing_context: Context, address: NumbaType, arguments: NumbaType) -> Emitter:
    """The same for a routine that has one more argument, its status, which is the result."""

    def generate(context: Context, builder: Builder, signature: NumbaType, values: Value) -> Value:
        status = cgutils.alloca_once_value(builder, ir.Constant(ir.IntType(32), 0))
        place = builder.bitcast(status, cgutils.voidptr_t)
        _called(context, builder, signature.args[1].types, values, (place,))
        return builder.load(status)

    return types.int32(types.int64, arguments), generate


@intrinsic
def address_of(typing_context: Context, array: NumbaType, place: NumbaType) -> Emitter:
    """Address of an entry of an array, counted from its first one."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.ptrtoint(builder.gep(data, [arguments[1]]), ir.IntType(64))

    return types.int64(array, types.int64), generate

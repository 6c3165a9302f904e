"""What two threads tell each other in an array of both; imported when something is compiled.

Both see these reads and writes in one order, and with each of them whatever was written before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import llvmlite.binding as llvm
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

if TYPE_CHECKING:
    from obseq.compilation.emission import Builder, Context, Emitter, NumbaType, Value

_IN_ORDER = "seq_cst"


@intrinsic
def seen(typing_context: Context, array: NumbaType, place: NumbaType) -> Emitter:
    """The number at a place, as the other thread has left it."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        return builder.load_atomic(_place(context, builder, signature, arguments), _IN_ORDER, 8)

    return types.int64(array, types.int64), generate


@intrinsic
def show(typing_context: Context, array: NumbaType, place: NumbaType, number: NumbaType) -> Emitter:
    """Writes a number to a place, for the other thread to see."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        builder.store_atomic(arguments[2], _place(context, builder, signature, arguments), _IN_ORDER, 8)
        return context.get_dummy_value()

    return types.void(array, types.int64, types.int64), generate


@intrinsic
def add(typing_context: Context, array: NumbaType, place: NumbaType, number: NumbaType) -> Emitter:
    """Adds to the number at a place, at one go; what it was before."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        place = _place(context, builder, signature, arguments)
        return builder.atomic_rmw("add", place, arguments[2], _IN_ORDER)

    return types.int64(array, types.int64, types.int64), generate


@intrinsic
def rest(typing_context: Context) -> Emitter:
    """Says to the processor that this thread looks at the same place again and again."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        if llvm.get_process_triple().startswith("x86_64"):
            kind = ir.FunctionType(ir.VoidType(), [])
            builder.call(cgutils.get_or_insert_function(builder.module, kind, "llvm.x86.sse2.pause"), [])
        return context.get_dummy_value()

    return types.void(), generate


@intrinsic
def call(typing_context: Context, address: NumbaType) -> Emitter:
    """Calls the function of the system at an address, which takes nothing and returns an `int`."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        function = ir.FunctionType(ir.IntType(32), [])
        result = builder.call(builder.inttoptr(arguments[0], function.as_pointer()), [])
        return builder.sext(result, ir.IntType(64))

    return types.int64(types.int64), generate


@intrinsic
def address_of(typing_context: Context, array: NumbaType) -> Emitter:
    """Where an array begins in memory."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.ptrtoint(data, ir.IntType(64))

    return types.int64(array), generate


@intrinsic
def rows_at(typing_context: Context, address: NumbaType, n: NumbaType, width: NumbaType) -> Emitter:
    """The array of n rows of doubles that begins at an address."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        address, n, width = arguments
        made = context.make_array(signature.return_type)(context, builder)
        itemsize = context.get_constant(types.intp, 8)
        context.populate_array(
            made,
            data=builder.inttoptr(address, ir.DoubleType().as_pointer()),
            shape=[n, width],
            strides=[builder.mul(width, itemsize), itemsize],
            itemsize=itemsize,
            meminfo=None,
        )
        return made._getvalue()

    return types.Array(types.float64, 2, "C")(types.int64, types.int64, types.int64), generate


def _place(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
    data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
    return builder.gep(data, [arguments[1]])

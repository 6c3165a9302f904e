"""Operations that kernels and loops use in LLVM's own terms; imported when something is compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

if TYPE_CHECKING:
    from obseq.compilation.emission import Builder, Context, Emitter, NumbaType, Value


@intrinsic
def call_address(typing_context: Context, address: NumbaType, base: NumbaType, n_tiles: NumbaType) -> Emitter:
    """Calls the compiled kernel at an address; the loop needs no compilation for another kernel."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        kernel = ir.FunctionType(ir.VoidType(), [ir.DoubleType().as_pointer(), ir.IntType(64)])
        pointer = builder.inttoptr(arguments[0], kernel.as_pointer())
        builder.call(pointer, [arguments[1], arguments[2]])
        return context.get_dummy_value()

    return types.void(types.int64, types.CPointer(types.float64), types.int64), generate


@intrinsic
def pointer_to(typing_context: Context, array: NumbaType, place: NumbaType) -> Emitter:
    """Pointer to an entry of an array of doubles, counted from its first one."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        return builder.gep(data, [arguments[1]])

    return types.CPointer(types.float64)(array, types.int64), generate


@intrinsic
def keep_loop(typing_context: Context) -> Emitter:
    """Marks a kernel whose lane loop is so short that LLVM would unroll it, and then not vectorise it."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        builder.function.attributes.add("optsize")
        return context.get_dummy_value()

    return types.void(), generate


@intrinsic
def bits_of(typing_context: Context, x: NumbaType) -> Emitter:
    """The bits of a float as a whole number."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        return builder.bitcast(arguments[0], ir.IntType(64))

    return types.uint64(types.float64), generate


@intrinsic
def float_of(typing_context: Context, bits: NumbaType) -> Emitter:
    """The float that has some bits."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        return builder.bitcast(arguments[0], ir.DoubleType())

    return types.float64(types.uint64), generate

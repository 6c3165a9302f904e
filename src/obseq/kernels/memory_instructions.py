"""Arrays larger than the caches: asked for ahead, and written straight to memory; imported when compiling.

A store of the usual kind reads the line that it writes to, which costs as much as the writing itself. And
memory rests while a kernel works, unless what comes next has been asked for: a little at a time, since a
processor waits for few lines at once, and stands still when it is asked for more.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

if TYPE_CHECKING:
    from obseq.compilation.emission import Builder, Context, Emitter, NumbaType, Value

_LINE = ir.VectorType(ir.DoubleType(), 8)
_INT32, _INT64 = ir.IntType(32), ir.IntType(64)
_BYTES = ir.IntType(8).as_pointer()
_LINE_BYTES = 64


@intrinsic
def stream(
    typing_context: Context, source: NumbaType, target: NumbaType, place: NumbaType, n: NumbaType
) -> Emitter:
    """Copies the first n doubles of an array to a place of another: whole lines past the caches."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        given = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        data = context.make_array(signature.args[1])(context, builder, arguments[1]).data
        written, n = builder.gep(data, [arguments[2]]), arguments[3]
        before = _smaller(builder, _before_line(builder, written), n)
        lines = builder.udiv(builder.sub(n, before), _INT64(8))
        after = builder.add(before, builder.mul(lines, _INT64(8)))
        _copy(builder, given, written, _INT64(0), before)
        with cgutils.for_range(builder, lines) as loop:
            at = builder.add(before, builder.mul(loop.index, _INT64(8)))
            line = builder.load(_line(builder, given, at), align=8)
            store = builder.store(line, _line(builder, written, at), align=_LINE_BYTES)
            store.set_metadata("nontemporal", builder.module.add_metadata([_INT32(1)]))
        _copy(builder, given, written, after, n)
        return context.get_dummy_value()

    return types.void(source, target, types.int64, types.int64), generate


@intrinsic
def finish_streams(typing_context: Context) -> Emitter:
    """What was written past the caches is there for all threads, before anything that comes after."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        builder.fence("seq_cst")
        return context.get_dummy_value()

    return types.void(), generate


@intrinsic
def ask_for(typing_context: Context, source: NumbaType, place: NumbaType, n: NumbaType) -> Emitter:
    """Has n doubles brought near, from a place of an array on, or beyond it; the work goes on meanwhile."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        kind = ir.FunctionType(ir.VoidType(), [_BYTES, _INT32, _INT32, _INT32])
        fetch = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        reading, second_cache, of_data = _INT32(0), _INT32(2), _INT32(1)
        lines = builder.udiv(builder.add(arguments[2], _INT64(7)), _INT64(8))
        with cgutils.for_range(builder, lines) as loop:
            at = builder.add(arguments[1], builder.mul(loop.index, _INT64(8)))
            line = builder.bitcast(builder.gep(data, [at]), _BYTES)
            builder.call(fetch, [line, reading, second_cache, of_data])
        return context.get_dummy_value()

    return types.void(source, types.int64, types.int64), generate


def _before_line(builder: Builder, pointer: Value) -> Value:
    """Doubles from a pointer to the next line of the caches."""
    address = builder.ptrtoint(pointer, _INT64)
    return builder.lshr(builder.and_(builder.neg(address), _INT64(_LINE_BYTES - 1)), _INT64(3))


def _smaller(builder: Builder, a: Value, b: Value) -> Value:
    return builder.select(builder.icmp_unsigned("<", a, b), a, b)


def _line(builder: Builder, data: Value, at: Value) -> Value:
    return builder.bitcast(builder.gep(data, [at]), _LINE.as_pointer())


def _copy(builder: Builder, source: Value, target: Value, first: Value, last: Value) -> None:
    with cgutils.for_range(builder, builder.sub(last, first)) as loop:
        at = builder.add(first, loop.index)
        builder.store(builder.load(builder.gep(source, [at])), builder.gep(target, [at]))

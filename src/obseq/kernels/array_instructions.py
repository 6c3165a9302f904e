"""Arrays in another shape, and narrow rows copied by vectors; imported when something is compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

if TYPE_CHECKING:
    from obseq.compilation.emission import Builder, Context, Emitter, NumbaType, Value

_FOUR = ir.VectorType(ir.DoubleType(), 4)
_INT32, _INT64 = ir.IntType(32), ir.IntType(64)


@intrinsic
def rows_of(typing_context: Context, array: NumbaType) -> Emitter:
    """An array of three dimensions as rows: the last two dimensions are one."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        given = context.make_array(signature.args[0])(context, builder, arguments[0])
        made = context.make_array(signature.return_type)(context, builder)
        n, m, k = cgutils.unpack_tuple(builder, given.shape, 3)
        columns = builder.mul(m, k)
        context.populate_array(
            made,
            data=given.data,
            shape=[n, columns],
            strides=[builder.mul(columns, given.itemsize), given.itemsize],
            itemsize=given.itemsize,
            meminfo=None,
        )
        return made._getvalue()

    return types.Array(types.float64, 2, "C")(array), generate


@intrinsic
def copy_ones(
    typing_context: Context, source: NumbaType, i: NumbaType, target: NumbaType, j: NumbaType
) -> Emitter:
    """Copies four doubles from place `i` to place `j`."""

    def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
        given, written = _places(context, builder, signature, arguments)
        builder.store(builder.load(given(0), align=8), written(0), align=8)
        return context.get_dummy_value()

    index = types.uint64
    return types.void(source, index, target, index), generate


def _pairs(stride_of_source: bool, masks: tuple[list[int], list[int]]) -> Value:
    """Two vectors of four doubles, shuffled to two others; `stride` is between those of the tile."""

    @intrinsic
    def copy_pairs(
        typing_context: Context,
        source: NumbaType,
        i: NumbaType,
        target: NumbaType,
        j: NumbaType,
        stride: NumbaType,
    ) -> Emitter:
        def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
            given, written = _places(context, builder, signature, arguments)
            steps = (arguments[4], _INT64(4)) if stride_of_source else (_INT64(4), arguments[4])
            first, second = builder.load(given(0), align=8), builder.load(given(steps[0]), align=8)
            for mask, step in zip(masks, (0, steps[1]), strict=True):
                order = ir.Constant(ir.VectorType(_INT32, 4), mask)
                builder.store(builder.shuffle_vector(first, second, order), written(step), align=8)
            return context.get_dummy_value()

        index = types.uint64
        return types.void(source, index, target, index, index), generate

    return copy_pairs


def _places(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
    """Where vectors are read and written, by their distance from the places that are given."""

    def place(array: int) -> Value:
        data = context.make_array(signature.args[array])(context, builder, arguments[array]).data

        def at(step: Value) -> Value:
            index = arguments[array + 1] if step == 0 else builder.add(arguments[array + 1], step)
            return builder.bitcast(builder.gep(data, [index]), _FOUR.as_pointer())

        return at

    return place(0), place(2)


split_pairs = _pairs(stride_of_source=False, masks=([0, 2, 4, 6], [1, 3, 5, 7]))
join_pairs = _pairs(stride_of_source=True, masks=([0, 4, 1, 5], [2, 6, 3, 7]))

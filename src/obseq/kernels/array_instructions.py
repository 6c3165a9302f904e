"""Arrays in another shape, and narrow rows copied by vectors; imported when something is compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

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


def _narrow(width: int, to_tile: bool) -> Value:
    """Copies four rows of so many doubles to four lanes of a tile, or back; `stride` is between its rows."""
    number = 4 * width

    @intrinsic
    def copy(
        typing_context: Context,
        source: NumbaType,
        i: NumbaType,
        target: NumbaType,
        j: NumbaType,
        stride: NumbaType,
    ) -> Emitter:
        def generate(context: Context, builder: Builder, signature: NumbaType, arguments: Value) -> Value:
            first, second = (_place(context, builder, signature, arguments, array) for array in (0, 2))
            tile, rows = (second, first) if to_tile else (first, second)
            together = builder.bitcast(rows, ir.VectorType(ir.DoubleType(), number).as_pointer())
            steps = [builder.mul(arguments[4], _INT64(k)) for k in range(width)]
            lanes = [builder.bitcast(builder.gep(tile, [step]), _FOUR.as_pointer()) for step in steps]
            if to_tile:
                loaded = builder.load(together, align=8)
                for k, lane in enumerate(lanes):
                    builder.store(_picked(builder, loaded, range(k, number, width)), lane, align=8)
            else:
                joined = _joined(builder, [builder.load(lane, align=8) for lane in lanes])
                order = [4 * k + lane for lane in range(4) for k in range(width)]
                builder.store(_picked(builder, joined, order), together, align=8)
            return context.get_dummy_value()

        index = types.uint64
        return types.void(source, index, target, index, index), generate

    return copy


def _place(context: Context, builder: Builder, signature: NumbaType, arguments: Value, array: int) -> Value:
    data = context.make_array(signature.args[array])(context, builder, arguments[array]).data
    return builder.gep(data, [arguments[array + 1]])


def _picked(builder: Builder, vector: Value, order: Iterable[int]) -> Value:
    """Entries of a vector, in an order."""
    places = list(order)
    mask = ir.Constant(ir.VectorType(_INT32, len(places)), places)
    return builder.shuffle_vector(vector, ir.Constant(vector.type, ir.Undefined), mask)


def _joined(builder: Builder, vectors: Sequence[Value]) -> Value:
    """Vectors of four one after the other, as one."""
    number = 4 * len(vectors)
    whole = ir.Constant(ir.VectorType(ir.DoubleType(), number), ir.Undefined)
    for k, vector in enumerate(vectors):
        wide = _picked(builder, vector, [entry % 4 for entry in range(number)])
        order = [number + entry - 4 * k if entry // 4 == k else entry for entry in range(number)]
        mask = ir.Constant(ir.VectorType(_INT32, number), order)
        whole = builder.shuffle_vector(whole, wide, mask)
    return whole


split_ones, split_twos, split_threes = (_narrow(width, to_tile=True) for width in (1, 2, 3))
join_ones, join_twos, join_threes = (_narrow(width, to_tile=False) for width in (1, 2, 3))

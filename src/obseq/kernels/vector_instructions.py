"""Four doubles at a time: the operations that assembly is made of, as LLVM vector instructions.

The compiler does not find them by itself in a loop over scalars (it emits one scalar instruction per
product), and they are most of the work between an observation and its normal equations. Imported when
something is compiled; `vectors` has their names.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

if TYPE_CHECKING:
    from obseq.compilation.emission import Builder, Context, Emitter, NumbaType, Value

_FOUR = ir.VectorType(ir.DoubleType(), 4)
_INT32 = ir.IntType(32)
_INT64 = ir.IntType(64)
_CONTRACT = ("contract",)


def _data(context: Context, builder: Builder, array_type: NumbaType, array: Value) -> Value:
    return context.make_array(array_type)(context, builder, array).data


def _address(builder: Builder, base: Value, index: Value) -> Value:
    return builder.bitcast(builder.gep(base, [index]), ir.PointerType(_FOUR))


def _load(builder: Builder, base: Value, index: Value) -> Value:
    return builder.load(_address(builder, base, index), align=8)


def _store(builder: Builder, vector: Value, base: Value, index: Value) -> None:
    builder.store(vector, _address(builder, base, index), align=8)


def _store_three(builder: Builder, vector: Value, base: Value, index: Value) -> None:
    """Leaves the fourth double alone: another thread may be adding to it."""
    pair = ir.PointerType(ir.VectorType(ir.DoubleType(), 2))
    first_two = _shuffle(builder, vector, vector, [0, 1])
    builder.store(first_two, builder.bitcast(builder.gep(base, [index]), pair), align=8)
    third = builder.gep(base, [builder.add(index, _INT64(2))])
    builder.store(builder.extract_element(vector, _INT32(2)), third)


def _shuffle(builder: Builder, first: Value, second: Value, mask: list[int]) -> Value:
    return builder.shuffle_vector(first, second, ir.Constant(ir.VectorType(_INT32, len(mask)), mask))


def _splat(builder: Builder, scalar: Value) -> Value:
    vector = builder.insert_element(ir.Constant(_FOUR, ir.Undefined), scalar, _INT32(0))
    return _shuffle(builder, vector, vector, [0, 0, 0, 0])


def _multiply_add(builder: Builder, total: Value, vector: Value, scalar: Value) -> Value:
    product = builder.fmul(vector, _splat(builder, scalar), flags=_CONTRACT)
    return builder.fadd(total, product, flags=_CONTRACT)


def _transpose(rows: int) -> Value:
    """Reads four doubles at four places; writes the first `rows` columns at `at + k stride`."""

    def emit(context: Context, builder: Builder, signature: NumbaType, args: Value) -> Value:
        source = _data(context, builder, signature.args[0], args[0])
        target = _data(context, builder, signature.args[5], args[5])
        a, b, c, d = (_load(builder, source, index) for index in args[1:5])
        even_ab, odd_ab = _shuffle(builder, a, b, [0, 4, 2, 6]), _shuffle(builder, a, b, [1, 5, 3, 7])
        even_cd, odd_cd = _shuffle(builder, c, d, [0, 4, 2, 6]), _shuffle(builder, c, d, [1, 5, 3, 7])
        columns = [
            _shuffle(builder, even_ab, even_cd, [0, 1, 4, 5]),
            _shuffle(builder, odd_ab, odd_cd, [0, 1, 4, 5]),
            _shuffle(builder, even_ab, even_cd, [2, 3, 6, 7]),
            _shuffle(builder, odd_ab, odd_cd, [2, 3, 6, 7]),
        ]
        at = args[6]
        for column in columns[:rows]:
            _store(builder, column, target, at)
            at = builder.add(at, args[7])
        return context.get_dummy_value()

    @intrinsic
    def transpose(
        typing: Context,
        source: NumbaType,
        i0: NumbaType,
        i1: NumbaType,
        i2: NumbaType,
        i3: NumbaType,
        target: NumbaType,
        at: NumbaType,
        stride: NumbaType,
    ) -> Emitter:
        index = types.uint64
        return types.void(source, index, index, index, index, target, index, index), emit

    return transpose


def _outer(columns: int, stepped: bool = False) -> Value:
    """Adds sum_r record[a + r w : +4] * record[b + r w + k] to four doubles, for k < columns, r < n.

    Column k is at `at + height k`; or, `stepped`, where the lower triangle by columns has it: each column is
    one shorter than the one before, the first has `height` entries, and only three doubles are written.
    """

    def emit(context: Context, builder: Builder, signature: NumbaType, args: Value) -> Value:
        _, at, height, _, a, b, width, n = args
        store = _data(context, builder, signature.args[0], args[0])
        record = _data(context, builder, signature.args[3], args[3])
        places = [at]
        for k in range(1, columns):
            step = builder.sub(height, _INT64(k)) if stepped else height
            places.append(builder.add(places[-1], step))
        totals = [cgutils.alloca_once_value(builder, _load(builder, store, place)) for place in places]
        with cgutils.for_range(builder, n) as loop:
            shift = builder.mul(loop.index, width)
            vector = _load(builder, record, builder.add(a, shift))
            if stepped:
                vector = _shuffle(builder, vector, ir.Constant(_FOUR, [0.0] * 4), [0, 1, 2, 4])
            for k, total in enumerate(totals):
                place = builder.add(builder.add(b, shift), _INT64(k))
                scalar = builder.load(builder.gep(record, [place]))
                builder.store(_multiply_add(builder, builder.load(total), vector, scalar), total)
        for place, total in zip(places, totals, strict=True):
            put = _store_three if stepped else _store
            put(builder, builder.load(total), store, place)
        return context.get_dummy_value()

    @intrinsic
    def outer(
        typing: Context,
        store: NumbaType,
        at: NumbaType,
        height: NumbaType,
        record: NumbaType,
        a: NumbaType,
        b: NumbaType,
        width: NumbaType,
        n: NumbaType,
    ) -> Emitter:
        index = types.uint64
        return types.void(store, index, index, record, index, index, index, index), emit

    return outer


def _outer_columns(quads: int, rank: int) -> Value:
    """Adds sum_r record[a + r w : +4 quads] * record[b + columns[k] + r w] to doubles at `at + height k`.

    For each k from `first` to before `last`, with r < rank; what is common to all columns stays in registers.
    """

    def emit(context: Context, builder: Builder, signature: NumbaType, args: Value) -> Value:
        _, at, height, _, a, b, width, _, first, last = args
        store = _data(context, builder, signature.args[0], args[0])
        record = _data(context, builder, signature.args[3], args[3])
        columns = _data(context, builder, signature.args[7], args[7])
        shifts = [builder.mul(width, _INT64(r)) for r in range(rank)]
        rows = [builder.add(a, shift) for shift in shifts]
        left = [
            [_load(builder, record, builder.add(row, _INT64(4 * q))) for row in rows] for q in range(quads)
        ]
        with cgutils.for_range(builder, builder.sub(last, first)) as loop:
            column = builder.load(builder.gep(columns, [builder.add(first, loop.index)]))
            here = builder.add(b, column)
            right = [builder.load(builder.gep(record, [builder.add(here, shift)])) for shift in shifts]
            place = builder.add(at, builder.mul(height, loop.index))
            for vectors in left:
                total = _load(builder, store, place)
                for vector, scalar in zip(vectors, right, strict=True):
                    total = _multiply_add(builder, total, vector, scalar)
                _store(builder, total, store, place)
                place = builder.add(place, _INT64(4))
        return context.get_dummy_value()

    @intrinsic
    def outer_columns(
        typing: Context,
        store: NumbaType,
        at: NumbaType,
        height: NumbaType,
        record: NumbaType,
        a: NumbaType,
        b: NumbaType,
        width: NumbaType,
        columns: NumbaType,
        first: NumbaType,
        last: NumbaType,
    ) -> Emitter:
        index = types.uint64
        given = store, index, index, record, index, index, index, columns, index, index
        return types.void(*given), emit

    return outer_columns


@intrinsic
def copy_threes(
    typing: Context, store: NumbaType, place: NumbaType, record: NumbaType, at: NumbaType, width: NumbaType
) -> Emitter:
    """Copies a pair of threes, columns 0, 4 and 7 from its place on, to four doubles of three rows."""

    def emit(context: Context, builder: Builder, signature: NumbaType, args: Value) -> Value:
        _, place, _, at, width = args
        store = _data(context, builder, signature.args[0], args[0])
        record = _data(context, builder, signature.args[2], args[2])
        for column in (0, 4, 7):
            _store(builder, _load(builder, store, builder.add(place, _INT64(column))), record, at)
            at = builder.add(at, width)
        return context.get_dummy_value()

    index = types.uint64
    return types.void(store, index, record, index, index), emit


@intrinsic
def solve_threes(
    typing: Context, record: NumbaType, at: NumbaType, width: NumbaType, factor: NumbaType
) -> Emitter:
    """Solves L Y = X for four columns of three rows in place.

    `factor`: the inverse diagonal of L, then its entries below: second, third of the first column, third of
    the second.
    """

    def emit(context: Context, builder: Builder, signature: NumbaType, args: Value) -> Value:
        _, at, width, _ = args
        record = _data(context, builder, signature.args[0], args[0])
        factor = _data(context, builder, signature.args[3], args[3])
        first, second, third, b_a, c_a, c_b = (
            _splat(builder, builder.load(builder.gep(factor, [_INT64(k)]))) for k in range(6)
        )
        places = [at, builder.add(at, width), builder.add(at, builder.add(width, width))]
        a, b, c = (_load(builder, record, place) for place in places)
        a = builder.fmul(a, first)
        b = builder.fmul(_minus(builder, b, b_a, a), second)
        c = builder.fmul(_minus(builder, _minus(builder, c, c_a, a), c_b, b), third)
        for vector, place in zip((a, b, c), places, strict=True):
            _store(builder, vector, record, place)
        return context.get_dummy_value()

    index = types.uint64
    return types.void(record, index, index, factor), emit


def _minus(builder: Builder, total: Value, factor: Value, vector: Value) -> Value:
    return builder.fsub(total, builder.fmul(factor, vector, flags=_CONTRACT), flags=_CONTRACT)


transpose3 = _transpose(3)
transpose4 = _transpose(4)
outer1 = _outer(1)
outer4 = _outer(4)
outer_threes = _outer(3, stepped=True)
outer_columns_1 = _outer_columns(1, 1)
outer_columns_2 = _outer_columns(2, 1)
outer_columns_3 = _outer_columns(3, 1)
outer_columns_1_by_3 = _outer_columns(1, 3)
outer_columns_2_by_3 = _outer_columns(2, 3)
outer_columns_3_by_3 = _outer_columns(3, 3)

"""Arrays seen in another shape, in LLVM's own terms; imported when something is compiled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

if TYPE_CHECKING:
    from obseq.compilation.emission import Builder, Context, Emitter, NumbaType, Value


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

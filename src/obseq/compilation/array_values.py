"""Arrays inside compiled functions as values, field by field, where numba keeps a copy of each in memory.

Numba has an array that is indexed written to the stack, whole, and each of its fields read from there: a
dozen instructions of LLVM's for one entry, which the optimiser takes out again. Here a field is taken from
the value. Both end as the same machine code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from llvmlite import ir

if TYPE_CHECKING:
    from collections.abc import Callable

    from obseq.compilation.emission import Builder, Context, NumbaType, Value


class ArrayValue:
    """What numba's own functions read and set of an array: its fields by name, and the whole value."""

    def __init__(self, context: Context, builder: Builder, kind: NumbaType, value: Value | None) -> None:
        self._context = context
        self._builder = builder
        self._fe_type = kind
        self._datamodel = context.data_model_manager[kind]
        self._given = value
        self._set: dict[str, Value] = {}

    def __getattr__(self, field: str) -> Value:
        """The value of a field."""
        if field.startswith("_"):
            raise AttributeError(field)
        if field in self._set:
            return self._set[field]
        return self._builder.extract_value(self._given, self._datamodel.get_field_position(field))

    def __setattr__(self, field: str, value: Value) -> None:
        """Sets the value of a field."""
        if field.startswith("_"):
            super().__setattr__(field, value)
        else:
            self._set[field] = value

    def _getvalue(self) -> Value:
        """The whole array, as functions are given it."""
        whole = self._given
        if whole is None:
            whole = ir.Constant(self._datamodel.get_value_type(), None)
        for field, value in self._set.items():
            place = self._datamodel.get_field_position(field)
            whole = self._builder.insert_value(whole, value, place)
        return whole


def of_values(in_memory: Callable[[NumbaType], Value]) -> Callable[[NumbaType], Value]:
    """Numba's `make_array` with values for fields; an array that is in memory stays there."""

    def make_array(kind: NumbaType) -> Value:
        def made(
            context: Context, builder: Builder, value: Value | None = None, ref: Value | None = None
        ) -> Value:
            if ref is not None:
                return in_memory(kind)(context, builder, ref=ref)
            return ArrayValue(context, builder, kind.as_array, value)

        return made

    return make_array

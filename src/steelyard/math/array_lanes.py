"""Lane vectors of whole arrays, for kernels that loop over the worlds of a batch.

    for first in range(0, worlds, LANES):
        x = load_row(state, row, first)
        store_row(values, row, first, x)
        store_column(observations, first, column, x)

Rows are those of arrays (rows, worlds), columns those of arrays (worlds, columns). Where a batch ends within a block,
what is loaded repeats the last world, and nothing is stored behind it. Entries may be float64 or float32; masks are
stored as bool.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.extending import intrinsic

from .lanes import lane, mask
from .pointers import LANES

_INDEX = ir.IntType(64)
_PLACES = [ir.Constant(ir.IntType(32), k) for k in range(LANES)]


def _entry(context: Any, builder: Any, kind: Any, array: Any, row: Any, column: Any) -> Any:
    """Address of an entry of a C-contiguous array of two axes."""
    struct = context.make_array(kind)(context, builder, array)
    width = builder.extract_value(struct.shape, 1)
    return builder.gep(struct.data, [builder.add(builder.mul(row, width), column)])


def _length(context: Any, builder: Any, kind: Any, array: Any, axis: int) -> Any:
    struct = context.make_array(kind)(context, builder, array)
    return builder.extract_value(struct.shape, axis)


def _is_whole(builder: Any, first: Any, length: Any) -> Any:
    return builder.icmp_signed("<=", builder.add(first, _INDEX(LANES)), length)


def _widened(builder: Any, value: Any) -> Any:
    double = ir.DoubleType()
    return value if value.type == double else builder.fpext(value, double)


def _loader(axis: int) -> Any:
    """An intrinsic that loads lanes along an axis."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array, row, column = args
        kind = sig.args[0]
        first = args[1 + axis]
        length = _length(context, builder, kind, array, axis)
        vector = ir.VectorType(ir.DoubleType(), LANES)
        out = cgutils.alloca_once(builder, vector)
        straight = axis == 1 and kind.dtype == types.float64
        with builder.if_else(_is_whole(builder, first, length)) as (whole, partly):
            for branch, ends in ((whole, False), (partly, True)):
                with branch:
                    if straight and not ends:
                        place = _entry(context, builder, kind, array, row, column)
                        place = builder.bitcast(place, vector.as_pointer())
                        value = builder.load(place, align=8)
                    else:
                        value = ir.Constant(vector, ir.Undefined)
                        last = builder.sub(length, _INDEX(1))
                        for k in range(LANES):
                            at = builder.add(first, _INDEX(k))
                            if ends:
                                inside = builder.icmp_signed("<", at, last)
                                at = builder.select(inside, at, last)
                            index = (row, at) if axis == 1 else (at, column)
                            place = _entry(context, builder, kind, array, *index)
                            entry = _widened(builder, builder.load(place))
                            value = builder.insert_element(value, entry, _PLACES[k])
                    builder.store(value, out)
        return builder.load(out)

    def make(typing_context: Any, array: Any, row: Any, column: Any) -> Any:
        return lane(array, types.int64, types.int64), codegen

    return intrinsic(make)


def _storer(axis: int) -> Any:
    """An intrinsic that stores lanes, or a mask, along an axis."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array, row, column, value = args
        kind = sig.args[0]
        first = args[1 + axis]
        length = _length(context, builder, kind, array, axis)
        entry = context.get_data_type(kind.dtype)
        vector = ir.VectorType(entry, LANES)
        if sig.args[3] == mask:
            value = builder.zext(value, vector)
        elif kind.dtype == types.float32:
            value = builder.fptrunc(value, vector)

        def put(k: int) -> None:
            at = builder.add(first, _INDEX(k))
            index = (row, at) if axis == 1 else (at, column)
            place = _entry(context, builder, kind, array, *index)
            builder.store(builder.extract_element(value, _PLACES[k]), place)

        with builder.if_else(_is_whole(builder, first, length)) as (whole, partly):
            with whole:
                if axis == 1:
                    place = _entry(context, builder, kind, array, row, column)
                    place = builder.bitcast(place, vector.as_pointer())
                    builder.store(value, place, align=1)
                else:
                    for k in range(LANES):
                        put(k)
            with partly:
                for k in range(LANES):
                    there = builder.icmp_signed("<", builder.add(first, _INDEX(k)), length)
                    with builder.if_then(there):
                        put(k)
        return context.get_dummy_value()

    def make(typing_context: Any, array: Any, row: Any, column: Any, value: Any) -> Any:
        value = mask if value == mask else lane
        return types.void(array, types.int64, types.int64, value), codegen

    return intrinsic(make)


#: ``load_row(array, row, first)``: entries ``first`` ... ``first + 7`` of a row.
load_row: Any = _loader(1)
#: ``load_column(array, first, column)``: the same of a column.
load_column: Any = _loader(0)
#: ``store_row(array, row, first, value)``.
store_row: Any = _storer(1)
#: ``store_column(array, first, column, value)``.
store_column: Any = _storer(0)

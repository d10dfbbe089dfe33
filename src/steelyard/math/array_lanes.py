"""Lane vectors of whole arrays, for kernels that loop over the worlds of a batch.

    for first in range(0, worlds, LANES):
        x = load_row(state, row, first)
        store_row(values, row, first, x)
        store_columns(observations, first, (x, y, z))

Rows are those of arrays (rows, worlds), columns those of arrays (worlds, columns). Where a batch ends within a block,
what is loaded behind it is 0, and nothing is stored there. Entries may be float64 or float32; masks are
stored as bool.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils

from .lanes import lane, mask, operation
from .pointers import LANES

_INDEX = ir.IntType(64)
_PLACES = [ir.Constant(ir.IntType(32), k) for k in range(LANES)]
_LANE_NUMBERS = ir.Constant(ir.VectorType(_INDEX, LANES), list(range(LANES)))
_ALIGNMENT = ir.Constant(ir.IntType(32), 1)


def _entry(context: Any, builder: Any, kind: Any, array: Any, row: Any, column: Any) -> Any:
    """Address of an entry of a C-contiguous array of two axes."""
    struct = context.make_array(kind)(context, builder, array)
    width = builder.extract_value(struct.shape, 1)
    return builder.gep(struct.data, [builder.add(builder.mul(row, width), column)])


def _left(context: Any, builder: Any, kind: Any, array: Any, axis: int, first: Any) -> Any:
    """How many worlds there are from the first on."""
    struct = context.make_array(kind)(context, builder, array)
    return builder.sub(builder.extract_value(struct.shape, axis), first)


def _inside(builder: Any, left: Any) -> Any:
    """Mask of the lanes that hold worlds: a mask costs less than a branch and the code behind it."""
    vector = _LANE_NUMBERS.type
    spread = builder.insert_element(ir.Constant(vector, ir.Undefined), left, _PLACES[0])
    first = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    spread = builder.shuffle_vector(spread, spread, first)
    return builder.icmp_signed("<", _LANE_NUMBERS, spread)


def _masked(builder: Any, name: str, vector: Any) -> Any:
    """LLVM's intrinsic that loads or stores the entries of a mask."""
    pointer = vector.as_pointer()
    bits = ir.VectorType(ir.IntType(1), LANES)
    if name == "load":
        kind = ir.FunctionType(vector, [pointer, _ALIGNMENT.type, bits, vector])
    else:
        kind = ir.FunctionType(ir.VoidType(), [vector, pointer, _ALIGNMENT.type, bits])
    entry = {"double": "f64", "float": "f32", "i8": "i8"}[str(vector.element)]
    full_name = f"llvm.masked.{name}.v{LANES}{entry}.p0"
    return cgutils.get_or_insert_function(builder.module, kind, full_name)


@operation
def load_row(typing_context: Any, array: Any, row: Any, first: Any) -> Any:
    """Entries ``first`` ... ``first + 7`` of a row of an array: ``load_row(array, row, first)``."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = sig.args[0]
        vector = ir.VectorType(context.get_data_type(kind.dtype), LANES)
        place = _entry(context, builder, kind, *args)
        place = builder.bitcast(place, vector.as_pointer())
        inside = _inside(builder, _left(context, builder, kind, args[0], 1, args[2]))
        nothing = ir.Constant(vector, [0.0] * LANES)
        load = _masked(builder, "load", vector)
        value = builder.call(load, [place, _ALIGNMENT, inside, nothing])
        wide = ir.VectorType(ir.DoubleType(), LANES)
        return value if vector == wide else builder.fpext(value, wide)

    return lane(array, types.int64, types.int64), codegen


@operation
def store_row(typing_context: Any, array: Any, row: Any, first: Any, value: Any) -> Any:
    """Entries ``first`` ... ``first + 7`` of a row: ``store_row(array, row, first, value)``."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array, row, first, value = args
        kind = sig.args[0]
        vector = ir.VectorType(context.get_data_type(kind.dtype), LANES)
        if sig.args[3] == mask:
            value = builder.zext(value, vector)
        elif value.type != vector:
            value = builder.fptrunc(value, vector)
        place = _entry(context, builder, kind, array, row, first)
        place = builder.bitcast(place, vector.as_pointer())
        inside = _inside(builder, _left(context, builder, kind, array, 1, first))
        store = _masked(builder, "store", vector)
        builder.call(store, [value, place, _ALIGNMENT, inside])
        return context.get_dummy_value()

    value = mask if value == mask else lane
    return types.void(array, types.int64, types.int64, value), codegen


@operation
def load_column(typing_context: Any, array: Any, first: Any, column: Any) -> Any:
    """Entries ``first`` ... ``first + 7`` of a column: ``load_column(array, first, column)``."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array, first, column = args
        kind = sig.args[0]
        left = _left(context, builder, kind, array, 0, first)
        entry = context.get_data_type(kind.dtype)
        vector = ir.VectorType(entry, LANES)
        out = cgutils.alloca_once_value(builder, ir.Constant(vector, [0.0] * LANES))

        def load(k: int) -> Any:
            at = builder.add(first, _INDEX(k))
            return builder.load(_entry(context, builder, kind, array, at, column))

        whole = builder.icmp_signed(">=", left, _INDEX(LANES))
        with builder.if_else(whole, likely=True) as (all_, some):
            with all_:
                value = ir.Constant(vector, ir.Undefined)
                for k in range(LANES):
                    value = builder.insert_element(value, load(k), _PLACES[k])
                builder.store(value, out)
            with some:
                for k in range(LANES):
                    with builder.if_then(builder.icmp_signed("<", _INDEX(k), left)):
                        value = builder.load(out)
                        builder.store(builder.insert_element(value, load(k), _PLACES[k]), out)
        wide = ir.VectorType(ir.DoubleType(), LANES)
        value = builder.load(out)
        return value if vector == wide else builder.fpext(value, wide)

    return lane(array, types.int64, types.int64), codegen


def _transposed(builder: Any, columns: list[Any]) -> list[Any]:
    """Eight vectors of eight numbers, rows for columns, in three rounds of exchanges."""
    places = ir.VectorType(ir.IntType(32), LANES)
    vectors = list(columns)
    distance = 1
    while distance < LANES:
        for k in range(LANES):
            if not k & distance:
                a, b = vectors[k], vectors[k + distance]
                upper = [j if not j & distance else LANES + j - distance for j in range(LANES)]
                lower = [j + distance if not j & distance else LANES + j for j in range(LANES)]
                vectors[k] = builder.shuffle_vector(a, b, ir.Constant(places, upper))
                vectors[k + distance] = builder.shuffle_vector(a, b, ir.Constant(places, lower))
        distance *= 2
    return vectors


@operation
def store_columns(typing_context: Any, array: Any, first: Any, values: Any) -> Any:
    """Rows ``first`` ... ``first + 7`` from their beginning: ``store_columns(array, first, (x, y, z))``."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        array, first, values = args
        kind = sig.args[0]
        left = _left(context, builder, kind, array, 0, first)
        entry = context.get_data_type(kind.dtype)
        vector = ir.VectorType(entry, LANES)
        columns = [builder.extract_value(values, k) for k in range(len(sig.args[2]))]
        if entry != ir.DoubleType():
            columns = [builder.fptrunc(column, vector) for column in columns]

        def put(k: int, group: int, row: Any, width: int) -> None:
            """The first numbers of a row, in pieces of 8, 4, 2 and 1."""
            begin = 0
            while begin < width:
                size = 1 << ((width - begin).bit_length() - 1)
                piece = ir.VectorType(entry, size)
                some = [ir.Constant(ir.IntType(32), begin + j) for j in range(size)]
                numbers = ir.Constant(ir.VectorType(ir.IntType(32), size), some)
                world = builder.add(first, _INDEX(k))
                column = _INDEX(LANES * group + begin)
                place = _entry(context, builder, kind, array, world, column)
                place = builder.bitcast(place, piece.as_pointer())
                part = builder.shuffle_vector(row, row, numbers)
                builder.store(part, place, align=1)
                begin += size

        groups = []
        for begin in range(0, len(columns), LANES):
            group = columns[begin : begin + LANES]
            spare = [ir.Constant(vector, ir.Undefined)] * (LANES - len(group))
            groups.append((len(group), _transposed(builder, group + spare)))
        whole = builder.icmp_signed(">=", left, _INDEX(LANES))
        with builder.if_else(whole, likely=True) as (all_, some):
            with all_:
                for k in range(LANES):
                    for number, (width, rows) in enumerate(groups):
                        put(k, number, rows[k], width)
            with some:
                for k in range(LANES):
                    with builder.if_then(builder.icmp_signed("<", _INDEX(k), left)):
                        for number, (width, rows) in enumerate(groups):
                            put(k, number, rows[k], width)
        return context.get_dummy_value()

    wanted = types.UniTuple(lane, len(values))
    return types.void(array, types.int64, wanted), codegen

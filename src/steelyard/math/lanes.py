"""Eight worlds in one register: the arithmetic that the stepping kernels are written in.

A *lane vector* holds one number for each of ``LANES`` neighbouring worlds. Kernels load it from a row of a
scratch array of shape (rows, LANES), compute on it as on a scalar and store it back. Each operation is one
IEEE operation per world, whatever the other seven hold: results cannot depend on the place of a world in
a batch, and there is no remainder loop. ``fma`` rounds once; plain ``a * b + c`` is never contracted.

Lane values exist only inside kernels. LLVM maps them to AVX-512, AVX2, SSE2 or NEON registers.

``nil`` is the type of what is zero in every world, the third coordinate of a planar scene: what is added to it stays
as it is, what is multiplied by it is nil, and no instruction is left of either.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.extending import intrinsic, lower_builtin, lower_cast, models, register_model
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from .pointers import FIRST, LANES


def operation(function: Any) -> Any:
    """numba's intrinsic, whose first parameter callers do not pass."""
    return intrinsic(function)


_DOUBLES = ir.VectorType(ir.DoubleType(), LANES)
_BITS = ir.VectorType(ir.IntType(1), LANES)
_BYTE = ir.IntType(LANES)


class LaneType(types.Type):
    """One float64 per world of a block."""

    def __init__(self) -> None:
        super().__init__(name=f"Lane{LANES}")


class MaskType(types.Type):
    """One truth value per world of a block."""

    def __init__(self) -> None:
        super().__init__(name=f"Mask{LANES}")


class NilType(types.Type):
    """Zero in every world of every block."""

    def __init__(self) -> None:
        super().__init__(name="Nil")

    def can_convert_to(self, typingctx: Any, other: Any) -> Any:
        """To a lane vector of zeros."""
        return Conversion.safe if isinstance(other, LaneType) else None


lane = LaneType()
mask = MaskType()
nil = NilType()

register_model(NilType)(models.OpaqueModel)


@lower_cast(NilType, LaneType)
def _zeros(context: Any, builder: Any, source: Any, target: Any, value: Any) -> Any:
    return ir.Constant(_DOUBLES, None)


@register_model(LaneType)
class _LaneModel(models.PrimitiveModel):
    def __init__(self, manager: Any, frontend: Any) -> None:
        super().__init__(manager, frontend, _DOUBLES)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):
    def __init__(self, manager: Any, frontend: Any) -> None:
        super().__init__(manager, frontend, _BITS)


def _row(builder: Any, pointer: Any, entry: Any) -> Any:
    """Address of the lane vector that begins at an entry."""
    return builder.bitcast(builder.gep(pointer, [entry]), _DOUBLES.as_pointer())


def _entry(builder: Any, row: Any) -> Any:
    return builder.mul(row, ir.Constant(ir.IntType(64), LANES))


def _load(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(_row(builder, args[0], _entry(builder, args[1])), align=64)


def _store(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], _row(builder, args[0], _entry(builder, args[1])), align=64)
    return context.get_dummy_value()


def _nothing(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return context.get_dummy_value()


@operation
def load(typing_context: Any, rows: Any, row: Any) -> Any:
    """Lane vector in row ``row`` of the scratch (rows, LANES), which starts on a cache line."""
    return lane(rows, types.int64), _load


@operation
def store(typing_context: Any, rows: Any, row: Any, value: Any) -> Any:
    """Write a lane vector to row ``row`` of the scratch."""
    return types.void(rows, types.int64, lane), _store


@operation
def load_z(typing_context: Any, rows: Any, row: Any) -> Any:
    """``load`` of a third coordinate: nil in a planar scene."""
    if rows.axes == 2:
        return nil(rows, types.int64), _nothing
    return lane(rows, types.int64), _load


@operation
def store_z(typing_context: Any, rows: Any, row: Any, value: Any) -> Any:
    """``store`` of a third coordinate: nothing in a planar scene."""
    return types.void(rows, types.int64, lane), _nothing if rows.axes == 2 else _store


@operation
def load_at(typing_context: Any, numbers: Any, entry: Any) -> Any:
    """Lane vector of ``LANES`` neighbouring entries."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_row(builder, *args), align=8)

    return lane(numbers, types.int64), codegen


@operation
def store_at(typing_context: Any, numbers: Any, entry: Any, value: Any) -> Any:
    """Write a lane vector to ``LANES`` neighbouring entries."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[2], _row(builder, *args[:2]), align=8)
        return context.get_dummy_value()

    return types.void(numbers, types.int64, lane), codegen


@operation
def splat(typing_context: Any, value: Any) -> Any:
    """The same scalar in every lane."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        undefined = ir.Constant(_DOUBLES, ir.Undefined)
        first = builder.insert_element(undefined, args[0], ir.Constant(ir.IntType(32), 0))
        zeros = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        return builder.shuffle_vector(first, undefined, zeros)

    return lane(types.float64), codegen


def _llvm(name: str, count: int) -> Any:
    """An intrinsic that calls an LLVM intrinsic of ``count`` lane vectors."""
    suffix = f"llvm.{name}.v{LANES}f64"

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.FunctionType(_DOUBLES, [_DOUBLES] * count)
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, suffix), args)

    return codegen


@operation
def fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a * b + c, rounded once."""
    if nil in (a, b):
        return c(a, b, c), lambda context, builder, sig, args: args[2]
    if c == nil:
        return lane(a, b, c), lambda context, builder, sig, args: builder.fmul(*args[:2])
    return lane(lane, lane, lane), _llvm("fma", 3)


@operation
def sqrt(typing_context: Any, a: Any) -> Any:
    """Square root, correctly rounded."""
    return lane(lane), _llvm("sqrt", 1)


@operation
def absolute(typing_context: Any, a: Any) -> Any:
    """Absolute value."""
    return lane(lane), _llvm("fabs", 1)


@operation
def select(typing_context: Any, condition: Any, yes: Any, no: Any) -> Any:
    """``yes`` in the lanes where the condition holds, ``no`` in the others."""
    if (yes, no) == (nil, nil):
        return nil(mask, nil, nil), _nothing

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(*args)

    return lane(mask, lane, lane), codegen


@operation
def any_lane(typing_context: Any, condition: Any) -> Any:
    """True when the condition holds in at least one lane."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.icmp_unsigned("!=", builder.bitcast(args[0], _BYTE), _BYTE(0))

    return types.boolean(mask), codegen


@operation
def one_lane(typing_context: Any, a: Any, index: Any) -> Any:
    """The number of one lane, 0 ... 7."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.extract_element(args[0], args[1])

    return types.float64(lane, types.int64), codegen


@operation
def sum_lanes(typing_context: Any, a: Any) -> Any:
    """Sum of all lanes, halves first: always in the same order."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        value, width = args[0], LANES
        while width > 1:
            width //= 2
            undefined = ir.Constant(value.type, ir.Undefined)
            halves = [
                builder.shuffle_vector(
                    value,
                    undefined,
                    ir.Constant(
                        ir.VectorType(ir.IntType(32), width), list(range(first, first + width))
                    ),
                )
                for first in (0, width)
            ]
            value = builder.fadd(*halves)
        return builder.extract_element(value, ir.Constant(ir.IntType(32), 0))

    return types.float64(lane), codegen


#: numba finds these for integers too, but only after it has tried them for much else, a millisecond each time.
_INDEX_ARITHMETIC = (operator.add, operator.sub, operator.mul)


def _with_nil(function: Any, a: types.Type, b: types.Type) -> types.Type | None:
    """Type of a sum, difference, product or quotient one of whose parts is nil; None for what divides by it."""
    if function is operator.mul or a == b:
        return None if function is operator.truediv else nil
    if function is operator.truediv:
        return nil if a == nil else None
    return lane


def _binary(function: Any, instruction: str, operand: types.Type) -> None:
    @infer_global(function)
    class _Template(AbstractTemplate):
        metadata = FIRST

        def generic(self, args: Any, kws: Any) -> Any:
            if args == (operand, operand):
                return signature(operand, operand, operand)
            if nil in args and operand == lane and set(args) <= {lane, nil}:
                result = _with_nil(function, *args)
                return None if result is None else signature(result, *args)
            if args == (types.int64, types.int64) and function in _INDEX_ARITHMETIC:
                return signature(types.int64, types.int64, types.int64)
            return None

    @lower_builtin(function, operand, operand)
    def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return getattr(builder, instruction)(*args)

    @lower_builtin(function, lane, nil)
    @lower_builtin(function, nil, lane)
    @lower_builtin(function, nil, nil)
    def _lower_nil(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if sig.return_type == nil:
            return context.get_dummy_value()
        if sig.args[1] == nil:
            return args[0]
        return args[1] if function is operator.add else builder.fneg(args[1])


@infer_global(operator.neg)
class _Negated(AbstractTemplate):
    metadata = FIRST

    def generic(self, args: Any, kws: Any) -> Any:
        return signature(args[0], args[0]) if args[0] in (lane, nil) else None


@lower_builtin(operator.neg, lane)
def _negate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


@lower_builtin(operator.neg, nil)
def _negate_nil(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return args[0]


def _comparison(function: Any, symbol: str) -> None:
    @infer_global(function)
    class _Template(AbstractTemplate):
        metadata = FIRST

        def generic(self, args: Any, kws: Any) -> Any:
            if args == (lane, lane):
                return signature(mask, lane, lane)
            return None

    @lower_builtin(function, lane, lane)
    def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        # Ordered comparisons: false where either side is NaN, so a broken world never keeps a loop alive.
        return builder.fcmp_ordered(symbol, *args)


for _function, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _binary(_function, _instruction, lane)
_binary(operator.and_, "and_", mask)
_binary(operator.or_, "or_", mask)
for _function, _symbol in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
):
    _comparison(_function, _symbol)

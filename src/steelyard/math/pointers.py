"""What stages get instead of arrays: bare pointers, since an array is seven arguments and its indices wrap.

``Tape`` points to integers that no kernel writes, ``Integers`` and ``Doubles`` to what kernels work on. They exist
only inside kernels, made by ``tape_at``, ``integers_at`` and ``doubles_at`` from an address. Indices
are not checked; ``doubles[row, k]`` is entry k of a row of LANES.

``PlanarDoubles`` is the scratch of a planar scene: the same rows, but kernels compiled for it leave out
whatever concerns the third coordinate (``axes``, ``lanes.load_z``).
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.extending import intrinsic, lower_builtin, models, register_model
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

#: Worlds per block: entries of a row of the scratch.
LANES = 8

#: numba tries what is made for this machine before what is made for any; else it would try all of its own first.
FIRST = {"target": "cpu"}

_INTEGER = ir.IntType(64)


class Pointer(types.Type):
    """Address of entries of one type."""

    def __init__(
        self, name: str, entry: types.Type, *, constant: bool = False, axes: int = 3
    ) -> None:
        self.entry = entry
        self.constant = constant
        self.axes = axes
        super().__init__(name=name)


class _PointerModel(models.PrimitiveModel):
    def __init__(self, manager: Any, frontend: Any) -> None:
        entry = _INTEGER if frontend.entry == types.int64 else ir.DoubleType()
        super().__init__(manager, frontend, entry.as_pointer())


register_model(Pointer)(_PointerModel)

Tape = Pointer("Tape", types.int64, constant=True)
Integers = Pointer("Integers", types.int64)
Doubles = Pointer("Doubles", types.float64)
PlanarDoubles = Pointer("PlanarDoubles", types.float64, axes=2)

_PAIR = types.UniTuple(types.int64, 2)


@infer_global(operator.getitem)
class _Get(AbstractTemplate):
    metadata = FIRST

    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], Pointer):
            index = _PAIR if isinstance(args[1], types.BaseTuple) else types.int64
            return signature(args[0].entry, args[0], index)
        return None


@infer_global(operator.setitem)
class _Set(AbstractTemplate):
    metadata = FIRST

    def generic(self, args: Any, kws: Any) -> Any:
        if isinstance(args[0], Pointer) and not args[0].constant:
            index = _PAIR if isinstance(args[1], types.BaseTuple) else types.int64
            return signature(types.none, args[0], index, args[0].entry)
        return None


def _pair_index(builder: Any, pair: Any) -> Any:
    row = builder.mul(builder.extract_value(pair, 0), ir.Constant(_INTEGER, LANES))
    return builder.add(row, builder.extract_value(pair, 1))


def _get(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    value = builder.load(builder.gep(args[0], [args[1]]))
    if sig.args[0].constant:
        # Nothing that is stored elsewhere can have changed it.
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value


def _set(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], builder.gep(args[0], [args[1]]))
    return context.get_dummy_value()


lower_builtin(operator.getitem, Pointer, types.int64)(_get)
lower_builtin(operator.setitem, Pointer, types.int64, types.Any)(_set)


@lower_builtin(operator.getitem, Pointer, types.UniTuple)
def _get_pair(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _get(context, builder, sig, (args[0], _pair_index(builder, args[1])))


@lower_builtin(operator.setitem, Pointer, types.UniTuple, types.Any)
def _set_pair(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _set(context, builder, sig, (args[0], _pair_index(builder, args[1]), args[2]))


def _maker(pointer: Pointer) -> Any:
    def make(typing_context: Any, address: Any) -> Any:
        def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(pointer))

        return pointer(types.int64), codegen

    return intrinsic(make)


tape_at = _maker(Tape)
integers_at = _maker(Integers)
doubles_at = _maker(Doubles)
planar_doubles_at = _maker(PlanarDoubles)


def constant_tape(words: Any) -> Any:
    """An intrinsic that gives a tape with these words, known when a kernel is compiled."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.ArrayType(_INTEGER, len(words))
        name = "steelyard.tape"
        tape = builder.module.globals.get(name)
        if tape is None:
            tape = ir.GlobalVariable(builder.module, kind, name)
            tape.linkage = "internal"
            tape.global_constant = True
            tape.initializer = ir.Constant(kind, [int(word) for word in words])
        return builder.bitcast(tape, _INTEGER.as_pointer())

    def make(typing_context: Any) -> Any:
        return Tape(), codegen

    return intrinsic(make)


def _axes(typing_context: Any, rows: Any) -> Any:
    """Number of coordinates that a scene moves in, known when a kernel is compiled."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _INTEGER(rows.axes)

    return types.int64(rows), codegen


def _spatial(typing_context: Any, rows: Any) -> Any:
    """The same rows, for code to which three is no number of coordinates."""
    return Doubles(rows), lambda context, builder, sig, args: args[0]


axes: Any = intrinsic(_axes)
spatial: Any = intrinsic(_spatial)


def _offset(typing_context: Any, pointer: Any, entries: Any) -> Any:
    """Pointer to ``entries`` further on."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.gep(args[0], [args[1]])

    return pointer(pointer, types.int64), codegen


offset: Any = intrinsic(_offset)

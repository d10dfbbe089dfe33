"""Stages: the compiled pieces that a step is made of, called by address.

A method's recipe is a list of stages on the tape. Each is compiled by itself when a scene first needs it, so what a
scene does not use costs neither time to compile nor an instruction, and machine code is made once
for all scenes, methods and environments.

Where a scene's many worlds are worth seconds of compiling, a stage can be compiled for that scene alone: its tape is
then a constant, so that indices, loops and branches are settled beforehand and numbers stay in registers. The
arithmetic is the same, to the bit.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import update_wrapper
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.caching import FunctionCache
from numba.core.ccallback import CFunc
from numba.core.extending import intrinsic

from .kernel import OPTIONS, KernelCompiler, UnfoldingCompiler, inner, source_stamp, stamp
from .math.pointers import Doubles, Integers, PlanarDoubles, Tape, constant_tape


class Stage:
    """A kernel that other kernels call through its address.

    Args:
        function: what to compile.
        arguments: numba types of its arguments; it returns nothing.
    """

    def __init__(self, function: Callable[..., None], arguments: tuple[types.Type, ...]) -> None:
        update_wrapper(self, function)  # type: ignore[arg-type]
        self._function = function
        self._arguments = arguments

        #: Machine code, by whether it is for planar scenes, and by digests of tapes.
        self._compiled: dict[bool, Any] = {}
        self._special: dict[str, Any] = {}

    def address(self, *, planar: bool) -> int:
        """Where its machine code lies; compiled, or loaded from the cache, at first."""
        if planar not in self._compiled:
            compiled = self._cfunc(self._function, planar, KernelCompiler)
            compiled.enable_caching()
            stamp(compiled._cache, self._function)
            compiled.compile()
            self._compiled[planar] = compiled
        address: int = self._compiled[planar].address
        return address

    def special_address(self, words: np.ndarray, part: int, *, planar: bool) -> int:
        """Where machine code lies that knows its tape and part; compiled, or loaded from the cache, at first.

        Args:
            words: the tape, in which no address may stand.
            part: which part of a step it is.
            planar: whether the scene is.
        """
        name = (self._function.__qualname__, *source_stamp(self._function), part, planar)
        key = hashlib.sha256(repr(name).encode() + words.tobytes()).hexdigest()
        if key not in self._special:
            body, tape = inner(self._function), constant_tape(words)

            def special(_tape, s, skip, _part):
                body(tape(), s, skip, part)

            compiled = self._cfunc(special, planar, UnfoldingCompiler)
            compiled._cache = _SpecialCache(special, key)
            stamp(compiled._cache, special)
            compiled.compile()
            self._special[key] = compiled
        address: int = self._special[key].address
        return address

    def _cfunc(self, function: Callable[..., None], planar: bool, compiler: Any) -> Any:
        scratch = PlanarDoubles if planar else Doubles
        arguments = tuple(scratch if a == Doubles else a for a in self._arguments)
        return CFunc(function, (arguments, types.void), {}, OPTIONS, pipeline_class=compiler)


class _SpecialCache(FunctionCache):
    """Numba's cache on disk, in which a key of one's own says what a function was made from."""

    def __init__(self, function: Callable[..., None], key: str) -> None:
        super().__init__(function)
        self._key = key

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return sig, codegen.magic_tuple(), self._key


def stage(function: Callable[..., None]) -> Stage:
    """A piece of a step: ``function(tape, s, skip, part)``.

    It gets the index tape, the scratch of one block of worlds, the flags of blocks left out of the matrix (and
    a few words behind them), and which part of the step it is: of most methods 0 in the first half, 1 in the second.
    """
    return Stage(function, (Tape, Doubles, Integers, types.int64))


def caller(arguments: tuple[types.Type, ...]) -> Any:
    """An intrinsic that calls a stage with such arguments at an address."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kinds = [context.get_value_type(argument) for argument in arguments]
        function = ir.FunctionType(ir.IntType(8).as_pointer(), kinds)
        builder.call(builder.inttoptr(args[0], function.as_pointer()), args[1:])
        return context.get_dummy_value()

    def signature(*given: types.Type) -> Any:
        # Scratch of planar scenes is passed on as such: the stage at the address was compiled for it.
        pairs = zip(given, arguments, strict=True)
        return types.void(types.int64, *(a if a == PlanarDoubles else b for a, b in pairs))

    def call_4(typing_context: Any, address: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
        return signature(a, b, c, d), codegen

    def call_6(
        typing_context: Any, address: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any
    ) -> Any:
        return signature(a, b, c, d, e, f), codegen

    # numba reads the number of arguments off the function.
    by_count: Any = {4: call_4, 6: call_6}
    return intrinsic(by_count[len(arguments)])


call_stage = caller((Tape, Doubles, Integers, types.int64))

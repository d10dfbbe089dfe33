"""Stages: the compiled pieces that a step is made of, called by address.

A method's recipe is a list of stages on the tape. Each is compiled by itself when a scene first needs it, so what a
scene does not use costs neither time to compile nor an instruction, and machine code is made once
for all scenes, methods and environments.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import update_wrapper
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.ccallback import CFunc
from numba.core.extending import intrinsic

from .kernel import OPTIONS, KernelCompiler, stamp
from .math.pointers import Doubles, Integers, PlanarDoubles, Tape


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

        #: Machine code, by whether it is for planar scenes.
        self._compiled: dict[bool, Any] = {}

    def address(self, *, planar: bool) -> int:
        """Where its machine code lies; compiled, or loaded from the cache, at first."""
        if planar not in self._compiled:
            scratch = PlanarDoubles if planar else Doubles
            arguments = tuple(scratch if a == Doubles else a for a in self._arguments)
            compiled: Any = CFunc(
                self._function, (arguments, types.void), {}, OPTIONS, pipeline_class=KernelCompiler
            )
            compiled.enable_caching()
            stamp(compiled._cache, self._function)
            compiled.compile()
            self._compiled[planar] = compiled
        address: int = self._compiled[planar].address
        return address


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

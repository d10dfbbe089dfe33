"""The ways this project compiles a function: ``kernel`` for Python to call, ``inner`` for kernels to call.

numba's disk cache looks at the file of the compiled function alone. A kernel that calls another file's
kernel would therefore keep running the old machine code after an edit there. Here every cache entry is
stamped with a digest of all engine sources and of the function's own file, so stale code cannot run.
"""

from __future__ import annotations

import gc
import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numba
from numba.core import typed_passes, untyped_passes
from numba.core.caching import IndexDataCacheFile
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import PassManager

_PACKAGE = Path(__file__).resolve().parent

#: Rounds of LLVM's optimisation of code that is unfolded.
_ROUNDS = 2

#: Divisions follow IEEE (no exception on zero); no fast-math.
OPTIONS: Any = {"nogil": True, "error_model": "numpy"}


@cache
def _digest(folder: Path) -> str:
    """Digest of every Python source below ``folder``, names included."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(str(path.relative_to(folder)).encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def source_stamp(function: Callable[..., Any]) -> tuple[str, str]:
    """What a cached machine code depends on: the engine's sources and the function's own folder."""
    return _digest(_PACKAGE), _digest(Path(function.__code__.co_filename).resolve().parent)


def stamp(store: Any, function: Callable[..., Any]) -> None:
    """Make numba's cache of a function depend on all engine sources."""
    implementation = getattr(store, "_impl", None)  # absent when NUMBA_DISABLE_JIT is set
    if implementation is not None:
        store._cache_file = IndexDataCacheFile(
            cache_path=implementation.locator.get_cache_path(),
            filename_base=implementation.filename_base,
            source_stamp=source_stamp(function),
        )


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function of plain arrays and scalars, without the GIL, cached on disk.

    Divisions follow IEEE (no exception on zero) and no fast-math is allowed, so results are the same
    bits wherever a world stands in a batch. Kernels allocate nothing and raise nothing.
    """
    dispatcher: Any = numba.njit(cache=True, pipeline_class=KernelCompiler, **OPTIONS)(function)
    stamp(getattr(dispatcher, "_cache", None), function)
    return dispatcher


class _Ingredient(JITCodeLibrary):
    """Code that is only ever linked into other code: optimised there, and never turned into machine code alone.

    numba would optimise and translate it here, once more in its caller, and so on up the call tree.
    """

    #: Nothing runs, so there is no place to write the environment of a run to.
    codegen = SimpleNamespace(set_env=lambda name, env: None)

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        return 0


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Compiling makes millions of objects that stay: looking for garbage among them takes a fifth of the time."""
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()


class KernelCompiler(Compiler):
    """Numba's compiler, in less time."""

    def compile_extra(self, func: Any) -> Any:
        """Compile a function and what it calls."""
        with _collector_paused():
            return super().compile_extra(func)


class _Unfolded(JITCodeLibrary):
    """Code into which all that it calls is inlined, so that what is constant in it is constant throughout."""

    def _optimize_final_module(self) -> None:
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage.name in (
                "linkonce_odr",
                "internal",
            ):
                function.add_function_attribute("alwaysinline")
        # What one round settles lets the next unroll more loops.
        for _ in range(_ROUNDS):
            super()._optimize_final_module()


class UnfoldingCompiler(KernelCompiler):
    """Numba's compiler for one function with all that it calls."""

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        unfolded = _Unfolded(target.codegen(), "unfolded")
        unfolded.enable_object_caching()
        super().__init__(typing, target, library or unfolded, *rest)


class _IngredientCompiler(KernelCompiler):
    #: Passes of numba's that find nothing in kernels: these have no closures, literals, ``with`` or ``raise``.
    idle: ClassVar[set[type]] = {
        untyped_passes.WithLifting,
        untyped_passes.InlineClosureLikes,
        untyped_passes.RewriteSemanticConstants,
        untyped_passes.DeadBranchPrune,
        untyped_passes.RewriteDynamicRaises,
        untyped_passes.MakeFunctionToJitFunction,
        untyped_passes.InlineInlinables,
        untyped_passes.FindLiterallyCalls,
        untyped_passes.LiteralUnroll,
        untyped_passes.LiteralPropagationSubPipelinePass,
        typed_passes.InlineOverloads,
        typed_passes.NopythonRewrites,
        typed_passes.NoPythonSupportedFeatureValidation,
        typed_passes.DumpParforDiagnostics,
    }

    def __init__(self, typing: Any, target: Any, library: Any, *rest: Any) -> None:
        super().__init__(typing, target, library or _Ingredient(target.codegen(), "inner"), *rest)

    def define_pipelines(self) -> list[Any]:
        """Numba's own pipeline, without what would look in vain."""
        (every,) = super().define_pipelines()
        some = PassManager(every.pipeline_name)
        for step, words in every.passes:
            if step not in self.idle:
                some.add_pass(step, words)
        some.finalize()
        return [some]


def inner(function: Callable[..., Any]) -> Any:
    """A kernel that only kernels call: no wrapper for Python, no machine code and no cache of its own."""
    settings: Any = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, **OPTIONS}
    return numba.njit(pipeline_class=_IngredientCompiler, **settings)(function)

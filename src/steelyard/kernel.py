"""The one way this project compiles a function: ``kernel``.

numba's disk cache looks at the file of the compiled function alone. A kernel that calls another file's
kernel would therefore keep running the old machine code after an edit there. Here every cache entry is
stamped with a digest of all engine sources and of the function's own file, so stale code cannot run.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile

_PACKAGE = Path(__file__).resolve().parent


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


def _compile(function: Callable[..., Any], **options: bool | str) -> Any:
    settings: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", **options}
    dispatcher: Any = numba.njit(**settings)(function)
    store: Any = getattr(dispatcher, "_cache", None)  # absent when NUMBA_DISABLE_JIT is set
    implementation = getattr(store, "_impl", None)
    if implementation is not None:
        store._cache_file = IndexDataCacheFile(
            cache_path=implementation.locator.get_cache_path(),
            filename_base=implementation.filename_base,
            source_stamp=source_stamp(function),
        )
    return dispatcher


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function of plain arrays and scalars, without the GIL, cached on disk.

    Divisions follow IEEE (no exception on zero) and no fast-math is allowed, so results are the same
    bits wherever a world stands in a batch. Kernels allocate nothing and raise nothing.
    """
    return _compile(function)


def inner(function: Callable[..., Any]) -> Any:
    """A kernel that only kernels call: the same, less the wrapper for Python, which takes long to compile."""
    return _compile(function, no_cpython_wrapper=True, no_cfunc_wrapper=True)


def part(function: Callable[..., Any]) -> Any:
    """An inner kernel that is copied into its one caller before either is compiled.

    LLVM optimises a kernel together with all that it calls, once for each level of a call tree. The few levels
    that hold nearly everything would each cost as much again.
    """
    return _compile(function, no_cpython_wrapper=True, no_cfunc_wrapper=True, inline="always")

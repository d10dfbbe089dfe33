"""Digests of numbers in kernels: whether any of many has changed, to the bit, from one."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core.extending import intrinsic

from ..kernel import inner

#: What a digest begins with.
EMPTY = 1469598103934665603
_FACTOR = 1099511628211
_BITS = (1 << 52) - 1


def _bits(typing_context: Any, value: Any) -> Any:
    """The bits of a number."""

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), codegen


bits: Any = intrinsic(_bits)


@inner
def mix(digest, value):
    """A digest with one more number.

    Source: Fowler, Noll & Vo's hash 1a, on words instead of bytes; the shift lets high bits reach the low ones.
    """
    digest = (digest ^ bits(value)) * _FACTOR
    return digest ^ (digest >> 29)


@inner
def digest_number(digest):
    """52 bits of a digest as a number of at least 2 and below 4."""
    return 2.0 + (digest & _BITS) * 2.0**-51

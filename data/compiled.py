"""How this package compiles: once, kept on disk, without the interpreter's lock.

numba's cache is keyed by the file of a kernel: kernels that call each other stand in one file, or the cache
goes stale.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array
from numpy.typing import NDArray

P = ParamSpec("P")
R = TypeVar("R")


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of numbers and arrays."""
    return cast("Callable[P, R]", numba.njit(cache=True, nogil=True, error_model="numpy")(function))


def lean_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile one that allocates nothing: counting references costs small parts more than their work."""
    compiling: Any = numba.njit  # whose types do not tell the last
    compiled = compiling(cache=True, nogil=True, error_model="numpy", _nrt=False)(function)
    return cast("Callable[P, R]", compiled)


def _word(typingctx: Any, block: Any, at: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = _array_of(signature.args[0])(context, builder, arguments[0])
        place = builder.gep(builder.bitcast(array.data, ir.IntType(8).as_pointer()), [arguments[1]])
        load = builder.load(builder.bitcast(place, ir.IntType(64).as_pointer()))
        load.align = 1
        return load

    return types.uint64(block, types.uint64), code


_array_of: Any = make_array
word = cast("Callable[[NDArray[np.uint8], Any], Any]", intrinsic(_word))
"""Within kernels: the eight bytes of a block from a place (uint64) on, as one little-endian uint64.

One load, wherever they stand. Nothing is checked: all eight have to lie in the block.
"""

"""Compilation of numerical kernels, and a cache that never answers with stale code.

numba's own cache key covers the file of the kernel alone: a kernel goes on answering with old machine
code after a function that it calls from another file was edited. The cache here adds to the key a digest
of everything that a kernel reaches by name: the source files of all kernels that it calls, directly or
through others, and of what generates machine code for them, the fields of named tuples, and the values of
the constants that they use, numba's types among them. The digest is taken when a signature is compiled or
loaded, so the order of definitions does not matter.

Three decorators:

- `compiled` for kernels with plain arguments (numbers, arrays). The machine code is kept on disk. They work
  on memory that they are given, and do not count references to it, which is dear: two atomic operations an
  array and call.
- `owning` for kernels that make arrays of their own.
- `specialised` for kernels that take compiled functions as arguments, such as an integrator that takes a
  vector field. They are compiled into the `compiled` kernel that calls them and are cached with it, not
  by themselves: numba identifies a function argument by the process that made it.

A function argument is given as `passed(kernel)`. Its type alone says which function it is; it has no
value at run time. (numba's own function arguments carry the address of a Python object, which no cache
can keep.)

A kernel that calls another one holds a copy of its machine code, optimised again with it. Where the callee
is an integrator that takes seconds to compile, the caller takes its address instead: `address_of` gives
it for a signature, once a process, and `calls(signature)` makes the function that calls what is there.

Both follow IEEE arithmetic to the letter (no fused or reordered operations, division by zero gives inf or
nan): some invariants of the systems solved here hold bit for bit. Both release the interpreter lock.
"""

from __future__ import annotations

import hashlib
import types
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils
from numba.core import types as numba_types
from numba.core.caching import FunctionCache
from numba.core.datamodel.models import OpaqueModel
from numba.core.datamodel.registry import register_default
from numba.core.dispatcher import Dispatcher
from numba.core.imputils import lower_constant
from numba.core.typing.templates import Signature
from numba.core.typing.typeof import typeof_impl
from numba.extending import intrinsic

P = ParamSpec("P")
R = TypeVar("R")

# options that numba's documentation does not list, but for the first two
_OWNING: dict[str, Any] = {"error_model": "numpy", "nogil": True, "_nrt": True}  # unset, it is the caller's
_BORROWING: dict[str, Any] = {**_OWNING, "_nrt": False}
_UNWRAPPED: dict[str, Any] = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` at its first call with given types; the result is cached on disk."""
    return _cached(numba.njit(**_BORROWING)(function), function)


def owning(function: Callable[P, R]) -> Callable[P, R]:
    """As `compiled`, for a kernel that makes arrays of its own."""
    return _cached(numba.njit(**_OWNING)(function), function)


def specialised(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function` into each kernel that calls it; its arguments may be compiled functions.

    It gets no wrapper to be called from Python by, which would take as long to compile as a short kernel.
    """
    kernel: Callable[P, R] = numba.njit(**_BORROWING, **_UNWRAPPED)(function)
    return kernel


def _cached(kernel: Any, function: Callable[P, R]) -> Callable[P, R]:
    kernel._cache = _ReachingCache(function)  # numba has no public way to choose a cache
    return cast("Callable[P, R]", kernel)


def passed(kernel: Callable[P, R]) -> Callable[P, R]:
    """A kernel as an argument for `specialised` kernels."""
    return cast("Callable[P, R]", _Passed(kernel))


class _Passed:
    def __init__(self, kernel: Callable[..., Any]) -> None:
        self.kernel = cast("Dispatcher[Callable[..., Any]]", kernel)

    def __call__(self, *arguments: Any) -> Any:
        return self.kernel(*arguments)


class _PassedType(numba_types.Dispatcher):
    """The type of a passed kernel: which kernel it is, and nothing else."""


register_default(_PassedType)(OpaqueModel)


@typeof_impl.register(_Passed)
def _type_of_passed(value: _Passed, _context: object) -> _PassedType:
    return _PassedType(value.kernel)


@lower_constant(_PassedType)  # type: ignore[no-untyped-call, untyped-decorator]  # numba leaves its lowering untyped
def _passed_at_run_time(context: Any, _builder: object, _type: object, _value: object) -> Any:
    return context.get_dummy_value()


def address_of(kernel: Callable[..., Any], signature: Signature) -> int:
    """Where the machine code of a kernel is in this process, compiled or loaded if need be; to be kept."""
    made: Any = cast("Dispatcher[Callable[..., Any]]", kernel).get_compile_result(signature)
    address: int = made.library.get_pointer_to_function(made.fndesc.llvm_func_name)
    return address


def calls(signature: Signature) -> Callable[[int, tuple[Any, ...]], Any]:
    """call(address, arguments): the kernel of this signature at an `address_of` it, for use in kernels."""

    @intrinsic
    def call(_typing_context: Any, address: Any, arguments: Any) -> Any:
        def generate(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            given = cgutils.unpack_tuple(builder, values[1])  # type: ignore[no-untyped-call]
            cast_to = zip(given, sig.args[1].types, signature.args, strict=True)
            passed_on = [context.cast(builder, value, have, want) for value, have, want in cast_to]
            convention = context.call_conv
            kind = convention.get_function_type(signature.return_type, signature.args)
            callee = builder.inttoptr(values[0], ir.PointerType(kind))
            status, result = convention.call_function(
                builder, callee, signature.return_type, signature.args, passed_on
            )
            with cgutils.if_unlikely(builder, status.is_error):  # type: ignore[no-untyped-call]
                convention.return_status_propagate(builder, status)
            return result

        return signature.return_type(address, arguments), generate

    return cast("Callable[[int, tuple[Any, ...]], Any]", call)


def generated(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of kernels whose machine code `function` generates; literal arguments are known to it."""
    return cast("Callable[..., Any]", intrinsic(prefer_literal=True)(function))


@generated
def unrolled(typing_context: Any, turn: Any, first: Any, stop: Any, carried: Any, given: Any) -> Any:
    """unrolled(turn, first, stop, carried, given): a loop laid out turn after turn; its bounds are literals.

    `carried` becomes turn(i, carried, given) for i = first..stop - 1, where `turn` is a passed kernel. Every
    i is a constant to the compiler, which lays out the loops inside a turn as well: short loops whose length
    changes with every turn cost more than what they compute.
    """
    form = typing_context.resolve_function_type(turn, (numba_types.int64, carried, given), {})

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        function = context.get_function(turn, form)
        context.add_linking_libs(getattr(function, "libs", ()))
        value = args[3]
        for i in range(first.literal_value, stop.literal_value):
            value = function(builder, (ir.Constant(ir.IntType(64), i), value, args[4]))
        return value

    return form.return_type(turn, first, stop, carried, given), generate


class _ReachingCache(FunctionCache):
    """numba's file cache with the digest of all that the kernel reaches in its key, and of how it is made."""

    def __init__(self, function: Callable[..., object]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]  # numba leaves its cache untyped
        self._function = function

    def _index_key(self, sig: object, codegen: object) -> tuple[object, ...]:
        key = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]  # as above
        return (*key, _contents(__file__), reach_digest(self._function))


def reach_digest(function: Callable[..., object]) -> str:
    """Digest of the source files and constants that a kernel reaches by name, hexadecimal.

    `function` is the Python function of a kernel, or a kernel.
    """
    function = getattr(function, "py_func", function)
    digest = hashlib.sha256()
    seen: set[Callable[..., object]] = set()
    files: set[str] = set()
    pending = [function]
    while pending:
        current = pending.pop()
        if current in seen:
            continue
        seen.add(current)
        files.add(current.__code__.co_filename)
        for name, value in sorted(_reached(current), key=lambda pair: pair[0]):
            for item in _flat(value):
                source = _source(item)
                if source is not None:
                    pending.append(source)
                elif isinstance(item, np.ndarray):
                    digest.update(f"{name}{item.dtype}{item.shape}".encode() + item.tobytes())
                elif isinstance(item, (bool, int, float, complex, str, numba_types.Type, Signature)):
                    digest.update(f"{name}={item!r}".encode())
                elif hasattr(item, "_fields"):
                    digest.update(f"{name}{item._fields}".encode())
    for file in sorted(files):
        digest.update(_contents(file))
    return digest.hexdigest()


def _source(item: Any) -> Callable[..., object] | None:
    """The Python function of a kernel, passed or not, or that which generates its machine code."""
    kernel = item.kernel if isinstance(item, _Passed) else item
    if isinstance(kernel, Dispatcher):
        return cast("Callable[..., object]", kernel.py_func)
    made_by = getattr(item, "_defn", None)  # where numba's intrinsics keep it
    return cast("Callable[..., object] | None", made_by)


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, tuple):
        for item in value:
            yield from _flat(item)
    else:
        yield value


def _reached(function: Callable[..., object]) -> Iterator[tuple[str, Any]]:
    """Globals that a function names, and what it names inside modules and closures."""
    names = frozenset(_names(function.__code__))
    for name in names:
        value = function.__globals__.get(name)
        if isinstance(value, types.ModuleType):
            for attribute in names & vars(value).keys():
                yield f"{name}.{attribute}", vars(value)[attribute]
        else:
            yield name, value
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents


def _names(code: types.CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


@cache
def _contents(file: str) -> bytes:
    path = Path(file)
    return hashlib.sha256(path.read_bytes()).digest() if path.exists() else file.encode()

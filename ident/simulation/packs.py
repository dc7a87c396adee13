"""Packs of doubles that a processor computes with at once, for kernels whose sums run side by side.

A pack is a value of 4 or 8 numbers inside a compiled kernel: `pack_at` and `place_pack` move it from and to
a contiguous array, `spread` repeats one number, `+`, `-`, `*` and `/` work number by number. A processor
with narrower registers takes a pack in several pieces: the numbers are the same everywhere, but for
`fused`, whose product is rounded before the sum where no fused operation exists.

numba has no such type; this one is a plain value, without reference counts, which is half its worth: a view
of a row of an array costs two atomic operations.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel.models import PrimitiveModel
from numba.core.datamodel.registry import register_default
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from ident.simulation.compiled import generated

DOUBLE = ir.DoubleType()
INDEX = ir.IntType(32)
LONG = ir.IntType(64)
EXPONENT_BIAS, FRACTION_BITS = 1023, 52  # of a double


class Pack(types.Type):
    """The numba type of a pack of `width` doubles."""

    def __init__(self, width: int) -> None:
        self.width = width
        super().__init__(name=f"pack{width}")

    @property
    def vector(self) -> Any:
        """The machine's type."""
        return ir.VectorType(DOUBLE, self.width)


class _PackModel(PrimitiveModel):
    def __init__(self, manager: Any, kind: Pack) -> None:
        super().__init__(manager, kind, kind.vector)  # type: ignore[no-untyped-call]


register_default(Pack)(_PackModel)


def _arithmetic(operation: Callable[..., Any], instruction: str) -> None:
    """Teach numba an operation on two packs of one width."""

    class _Template(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            alike = len(args) == 2 and isinstance(args[0], Pack) and args[0] == args[1]
            return signature(args[0], *args) if alike else None  # type: ignore[no-untyped-call]

    infer_global(operation)(_Template)  # type: ignore[no-untyped-call]

    def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return getattr(builder, instruction)(*args)

    lower_builtin(operation, Pack, Pack)(_lower)  # type: ignore[no-untyped-call]


_arithmetic(operator.add, "fadd")
_arithmetic(operator.sub, "fsub")
_arithmetic(operator.mul, "fmul")
_arithmetic(operator.truediv, "fdiv")


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any, kind: Pack) -> Any:
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index], inbounds=True), kind.vector.as_pointer())


@generated
def pack_at(typing_context: Any, width: Any, array: Any, index: Any) -> Any:
    """pack_at(width, array, index): the `width` numbers of a contiguous array from a flat index on."""
    kind = Pack(width.literal_value)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pointer = _pointer(context, builder, sig.args[1], args[1], args[2], kind)
        return builder.load(pointer, align=8, typ=kind.vector)

    return kind(width, array, types.intp), generate


@generated
def place_pack(typing_context: Any, array: Any, index: Any, pack: Any) -> Any:
    """place_pack(array, index, pack): write a pack to a contiguous array from a flat index on."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[2], _pointer(context, builder, sig.args[0], args[0], args[1], pack), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, pack), generate


@generated
def spread(typing_context: Any, width: Any, number: Any) -> Any:
    """spread(width, number): a pack of one number."""
    kind = Pack(width.literal_value)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _spread(builder, kind, args[1])

    return kind(width, types.float64), generate


@generated
def spread_as(typing_context: Any, pack: Any, number: Any) -> Any:
    """spread_as(pack, number): a pack of one number, as wide as another."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _spread(builder, pack, args[1])

    return pack(pack, types.float64), generate


@generated
def packed(typing_context: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """packed(a, b, c, d): a pack of four numbers."""
    kind = Pack(4)

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        pack = ir.Constant(kind.vector, ir.Undefined)
        for place, number in enumerate(args):
            pack = builder.insert_element(pack, number, INDEX(place))
        return pack

    return kind(types.float64, types.float64, types.float64, types.float64), generate


@generated
def number_of(typing_context: Any, pack: Any, place: Any) -> Any:
    """number_of(pack, place): one of a pack's numbers; the place is a literal."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.extract_element(args[0], INDEX(place.literal_value))

    return types.float64(pack, place), generate


@generated
def larger(typing_context: Any, a: Any, b: Any) -> Any:
    """larger(a, b): the larger of two packs, number by number; where one is nan, the second."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered(">", *args), *args)

    return a(a, a), generate


@generated
def smaller(typing_context: Any, a: Any, b: Any) -> Any:
    """smaller(a, b): the smaller of two packs, number by number; where one is nan, the second."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered("<", *args), *args)

    return a(a, a), generate


@generated
def chosen(typing_context: Any, sign: Any, a: Any, b: Any) -> Any:
    """chosen(sign, a, b): a where sign <= 0, else b, number by number."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        zero = ir.Constant(sign.vector, [0.0] * sign.width)
        return builder.select(builder.fcmp_ordered("<=", args[0], zero), args[1], args[2])

    return sign(sign, sign, sign), generate


@generated
def total(typing_context: Any, pack: Any) -> Any:
    """total(pack): the sum of the numbers of a pack, in two halves."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        numbers = [builder.extract_element(args[0], INDEX(place)) for place in range(pack.width)]
        while len(numbers) > 1:
            half = len(numbers) // 2
            pairs = zip(numbers[:half], numbers[half:], strict=True)
            numbers = [builder.fadd(one, other) for one, other in pairs]
        return numbers[0]

    return types.float64(pack), generate


@generated
def magnitude(typing_context: Any, a: Any) -> Any:
    """magnitude(a): |a|, number by number."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(builder, "fabs", a, args)

    return a(a), generate


@generated
def nearest(typing_context: Any, a: Any) -> Any:
    """nearest(a): the nearest whole numbers, the even of two."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(builder, "rint", a, args)

    return a(a), generate


@generated
def scaled_two(typing_context: Any, a: Any) -> Any:
    """scaled_two(a): 2^a for whole numbers a within -1022 and 1023."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole = ir.VectorType(LONG, a.width)
        bias, shift = (ir.Constant(whole, [value] * a.width) for value in (EXPONENT_BIAS, FRACTION_BITS))
        exponent = builder.add(builder.fptosi(args[0], whole), bias)
        return builder.bitcast(builder.shl(exponent, shift), a.vector)

    return a(a), generate


@generated
def rough_log2(typing_context: Any, a: Any) -> Any:
    """rough_log2(a): log2 of positive numbers, at most 0.086 too small: exponent and fraction as they are."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        bits = builder.bitcast(args[0], ir.VectorType(LONG, a.width))
        unit = ir.Constant(a.vector, [2.0**-FRACTION_BITS] * a.width)
        bias = ir.Constant(a.vector, [float(EXPONENT_BIAS)] * a.width)
        return builder.fsub(builder.fmul(builder.sitofp(bits, a.vector), unit), bias)

    return a(a), generate


def _spread(builder: Any, kind: Pack, number: Any) -> Any:
    first = builder.insert_element(ir.Constant(kind.vector, ir.Undefined), number, INDEX(0))
    return builder.shuffle_vector(
        first, first, ir.Constant(ir.VectorType(INDEX, kind.width), [0] * kind.width)
    )


def _call(builder: Any, name: str, kind: Pack, args: Any) -> Any:
    form = ir.FunctionType(kind.vector, [kind.vector] * len(args))
    of_pack = f"llvm.{name}.v{kind.width}f64"
    function = cgutils.get_or_insert_function(builder.module, form, of_pack)  # type: ignore[no-untyped-call]
    return builder.call(function, args)


@generated
def fused(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """fused(a, b, c): a b + c of three packs, in one rounding where the machine can."""

    def generate(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(builder, "fmuladd", a, args)

    return a(a, a, a), generate

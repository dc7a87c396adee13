"""The polynomials of a step: rows of ascending coefficients, four terms at a time.

A step gives each state as a polynomial in theta = t / length. Its terms are summed in packs (`packs`), so
that four additions at a time wait for each other instead of one.
"""

from __future__ import annotations

from typing import Any

from ident.simulation.compiled import compiled, specialised
from ident.simulation.filippov_system import FloatArray
from ident.simulation.packs import fused, magnitude, number_of, pack_at, packed, place_pack, spread, total


@specialised
def powers(x: float) -> Any:
    """x, x^2, x^3, x^4 as a pack."""
    square = x * x
    return packed(x, square, square * x, square * square)


@compiled
def scale(polynomials: FloatArray, rows: int, degree: int, length: float) -> None:
    """Turn series in time into polynomials in theta: coefficient k of the first `rows` times length^k."""
    columns = polynomials.shape[1]
    first = powers(length)
    leap = spread(4, (length * length) * (length * length))
    whole = degree - degree % 4
    for i in range(rows):
        row = i * columns
        power = first
        for k in range(1, whole, 4):
            place_pack(polynomials, row + k, pack_at(4, polynomials, row + k) * power)
            power = power * leap
        left = number_of(power, 0)
        for k in range(whole + 1, degree + 1):
            polynomials[i, k] *= left
            left *= length


@compiled
def sum_up(polynomials: FloatArray, rows: int, degree: int, end: FloatArray, spreads: FloatArray) -> None:
    """Values (rows,) at theta = 1, and the furthest (rows,) that they can be from those at 0 on the way."""
    columns = polynomials.shape[1]
    whole = degree - degree % 4
    for i in range(rows):
        row = i * columns
        values, bounds = spread(4, 0.0), spread(4, 0.0)
        for k in range(1, whole, 4):
            terms = pack_at(4, polynomials, row + k)
            values, bounds = values + terms, bounds + magnitude(terms)
        value, bound = total(values), total(bounds)
        for k in range(whole + 1, degree + 1):
            value, bound = value + polynomials[i, k], bound + abs(polynomials[i, k])
        end[i], spreads[i] = polynomials[i, 0] + value, bound


@compiled
def evaluate(polynomials: FloatArray, rows: int, degree: int, at: float, out: FloatArray) -> None:
    """Values (rows,) of the first `rows` polynomials at theta = `at`: Horner's rule in at^4."""
    columns = polynomials.shape[1]
    first = powers(at)
    leap = spread(4, (at * at) * (at * at))
    whole = degree - degree % 4
    for i in range(rows):
        row = i * columns
        left = 0.0
        for k in range(degree, whole, -1):
            left = left * at + polynomials[i, k]
        values = packed(left, 0.0, 0.0, 0.0)
        for k in range(whole - 3, 0, -4):
            values = fused(values, leap, pack_at(4, polynomials, row + k))
        out[i] = polynomials[i, 0] + total(values * first)

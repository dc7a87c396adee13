r"""The band in which a motion says what its torque was for: where the low-pass cuts off.

Above some frequency the position holds nothing but its own rounding, and the torque nothing but what the
motion does not answer. Two conditions, judged in bands of a third of an octave:

- the position stands clear of its noise floor (what holds for the position holds for the acceleration);
- the residual of the fitted law carries less than a tenth of the torque's power.

The highest band that meets them sets the cut-off. The second needs a fit, which needs a cut-off: it starts
from the first and goes round until it stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.signal import detrend, welch

from data.recording import FloatArray
from ident.excitation.direction import position_noise
from ident.excitation.filtering import (
    HIGHEST,
    Timing,
    acting,
    difference,
    equation,
    low_pass,
    second_difference,
    sharp_cutoff,
)
from ident.excitation.inverse_dynamics import FrictionTerms, LinearFit, least_squares, system
from ident.excitation.spans import Span

CLEAR: Final = 100.0  # power of the position over its noise floor
EXPLAINED: Final = 0.1  # power of the residual in the torque's
ROUNDS: Final = 6
BANDS: Final = 3  # an octave
SEGMENTS: Final = 16.0  # of the longest span, for the spectra
LEAST: Final = 20.0  # periods of the cut-off in the longest span


def cutoff_frequency(pieces: Sequence[Span], *, terms: FrictionTerms, timing: Timing) -> float:
    """The cut-off [Hz] for the spans of a rig, all of one sample rate or nearly so."""
    longest = max(pieces, key=lambda piece: piece.duration)
    top = HIGHEST / max(piece.period for piece in pieces)
    lowest = min(LEAST / longest.duration, top)
    edges = band_edges(lowest, top)
    cutoff = max(_clear_of_noise(longest, edges), lowest)
    tried: list[float] = []
    while len(tried) < ROUNDS and cutoff not in tried:
        tried.append(cutoff)
        made = [equation(piece, cutoff=cutoff, timing=timing) for piece in pieces]
        equations = [one for one in made if one is not None]
        fit = least_squares(system(equations, terms)) if equations else None
        if fit is None:
            break
        cutoff = max(_explained(longest, fit, terms, edges, cutoff=cutoff, timing=timing), lowest)
    return tried[-1] if cutoff in tried or not tried else cutoff


def band_edges(lowest: float, top: float) -> FloatArray:
    """Edges [Hz] of the bands from `lowest` to `top`."""
    number = max(1, round(BANDS * np.log2(top / lowest))) if top > lowest else 1
    return np.asarray(np.geomspace(lowest, top, number + 1))


def _clear_of_noise(span: Span, edges: FloatArray) -> float:
    noise = position_noise(span.position)
    floor = 2.0 * span.period * max(noise**2, (span.resolution or 0.0) ** 2 / 12.0)
    frequency, power = spectrum(span.position, span.period)
    return highest_band(frequency, power, np.full_like(power, CLEAR * floor), edges)


def _explained(
    span: Span, fit: LinearFit, terms: FrictionTerms, edges: FloatArray, *, cutoff: float, timing: Timing
) -> float:
    one = equation(span, cutoff=cutoff, timing=timing)
    if one is None:
        return cutoff
    h = span.period
    rate = difference(span.position, h)  # raw: the position's noise must show
    second = second_difference(span.position, h, timing=timing)
    columns = np.column_stack([second, *terms.of(replace(one.motion, rate=rate))])
    torque = acting(span.torque, h, timing=timing, delay=0.0)
    sharp = sharp_cutoff(cutoff, h)
    given, left = (
        low_pass(signal, sharp, h) * one.weight for signal in (torque, torque - columns @ fit.values)
    )
    frequency, torque_power = spectrum(given, h)
    _, power = spectrum(left, h)
    reached = edges[edges <= max(sharp, edges[1])]
    return min(
        _clear_of_noise(span, edges), highest_band(frequency, EXPLAINED * torque_power, power, reached)
    )


def _without_line(stretch: FloatArray) -> FloatArray:
    return np.asarray(detrend(stretch, type="linear"))


def highest_band(frequency: FloatArray, power: FloatArray, needed: FloatArray, edges: FloatArray) -> float:
    """Upper edge [Hz] of the highest band in which a power (m,) exceeds the needed one; else the lowest."""
    band = np.searchsorted(edges, frequency, side="right") - 1
    inside = (band >= 0) & (band < edges.size - 1)
    number = edges.size - 1
    there = np.bincount(band[inside], power[inside], number)
    least = np.bincount(band[inside], needed[inside], number)
    good = np.flatnonzero((there >= least) & (there > 0))
    return float(edges[good[-1] + 1]) if good.size else float(edges[0])


def spectrum(signal: FloatArray, period: float) -> tuple[FloatArray, FloatArray]:
    """One-sided power spectrum of a signal (n,): frequency [Hz], density."""
    length = max(64, int(signal.size / SEGMENTS))
    length = min(length, signal.size)
    frequency, power = welch(signal, 1.0 / period, nperseg=length, detrend=_without_line)
    return np.asarray(frequency), np.asarray(power)

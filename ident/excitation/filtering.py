r"""From a span of position and torque to the equation of motion, low-passed alike on both sides.

    u(t - d) = J a + b v + F_c sign(v) + ...

Every term goes through the same zero-phase low-pass (Butterworth, forwards and backwards), so that the
equation still holds behind it; derivatives are differences before it (the order of linear operations does
not matter), as in the inverse dynamic identification of Gautier (1997) with its parallel filter. The
filter's reach is cut off at both ends of a span.

Two conventions of logging are known. A torque that is *held* from its stamp to the next obeys

    (u_k + u_{k-1}) / 2 = J (q_{k+1} - 2 q_k + q_{k-1}) / h^2 + ...

exactly for a pure inertia. A torque that was *measured* at the stamp stands beside derivatives of the fourth
order at that stamp. Which one a log follows is a matter of half a sample (`ident.excitation.timing`).

While the link may stick its friction is anything up to F_s, and a saturated torque is not the one that
acted: there the equation does not hold. It is therefore multiplied by a weight, zero there and one
elsewhere, between two filters: a sharp one, which lets the derivatives be taken and reaches little beyond
the doubt, and the one that sets the band. A turn whose moment is known well within the band is no doubt.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from scipy.signal import butter, sosfiltfilt

from data.recording import FloatArray
from ident.excitation.direction import direction_of_motion, position_step
from ident.excitation.spans import Span

BoolArray = NDArray[np.bool_]
Timing = Literal["held", "measured"]

ORDER: Final = 4
HIGHEST: Final = 0.1  # cut-off in parts of the sample rate: differences are derivatives below
REACH: Final = 2.5  # of the filter, in periods of its cut-off: its response has faded to a quarter percent
SHARPNESS: Final = 4.0  # cut-off of the sharp filter in cut-offs
SHARPEST: Final = 0.25  # the same in parts of the sample rate
SHARP_REACH: Final = 1.5  # in periods of its own cut-off
BRIEF: Final = 0.03  # of a period of the cut-off: a doubt that the band does not resolve
INSTANT: Final = 3  # samples: a doubt that the log does not resolve
SAMPLES: Final = 4.0  # kept per period of the cut-off


@dataclass(frozen=True)
class Motion:
    """What friction depends on, at every sample of a span; all (n,)."""

    position: FloatArray  # [rad]
    rate: FloatArray  # [rad/s], what stands where a term is linear in the speed; it may be noisy
    direction: FloatArray  # (n,) +1 or -1 [-]


@dataclass(frozen=True)
class Equation:
    """What a span says at m instants, filtered; the terms of the friction still to be chosen."""

    span: Span
    cutoff: float  # [Hz]
    kept: NDArray[np.intp]  # (m,) sample numbers of the span
    torque: FloatArray  # (m,) [N m]
    acceleration: FloatArray  # (m,) [rad/s^2]
    motion: Motion
    weight: FloatArray  # (n,) [-], 0 where the equation does not hold, else 1

    def filtered(self, signal: FloatArray) -> FloatArray:
        """A signal of the span (n,) through both filters and the weight, at the instants kept (m,)."""
        return _banded(signal, self.weight, self.cutoff, self.span.period)[self.kept]

    @property
    def left_out(self) -> float:
        """Part of the span in which the link may stick or the torque saturates."""
        return float(1.0 - np.mean(self.weight))


def low_pass(signal: FloatArray, cutoff: float, period: float) -> FloatArray:
    """Zero-phase Butterworth of a signal (n,)."""
    sections = butter(ORDER, 2.0 * cutoff * period, output="sos")
    return np.asarray(
        sosfiltfilt(sections, signal, padlen=min(signal.size - 1, round(3 / (cutoff * period))))
    )


def sharp_cutoff(cutoff: float, period: float) -> float:
    """Cut-off [Hz] of the sharp filter."""
    return min(SHARPNESS * cutoff, SHARPEST / period)


def equation(span: Span, *, cutoff: float, timing: Timing, delay: float = 0.0) -> Equation | None:
    """The equation of motion of a span; None where the filter leaves nothing of it.

    `delay` [s] is how much later than the convention says the torque acts.
    """
    h, n = span.period, span.position.size
    reach = int(np.ceil(REACH / (cutoff * h)))
    if n <= 2 * reach + 8:
        return None
    direction, dwell = direction_of_motion(span.position, position_step(span.position, span.resolution))
    doubt = (dwell > max(BRIEF / (cutoff * h), INSTANT)) | span.saturated
    near = int(np.ceil(SHARP_REACH / (sharp_cutoff(cutoff, h) * h)))
    weight = 1.0 - (binary_dilation(doubt, iterations=near) if doubt.any() else doubt).astype(np.float64)
    inside = np.zeros(n, dtype=np.bool_)
    inside[reach : n - reach] = True
    inside &= low_pass(weight, cutoff, h) > 0.5
    thin = max(1, int(1.0 / (SAMPLES * cutoff * h)))
    kept = np.flatnonzero(inside)
    kept = kept[kept % thin == 0]
    if kept.size == 0:
        return None
    speed = low_pass(difference(span.position, h), sharp_cutoff(cutoff, h), h)
    torque = acting(span.torque, h, timing=timing, delay=delay)
    second = second_difference(span.position, h, timing=timing)
    return Equation(
        span=span,
        cutoff=cutoff,
        kept=kept,
        torque=_banded(torque, weight, cutoff, h)[kept],
        acceleration=_banded(second, weight, cutoff, h)[kept],
        motion=Motion(span.position, speed, direction),
        weight=weight,
    )


def acting(torque: FloatArray, period: float, *, timing: Timing, delay: float) -> FloatArray:
    """The torque (n,) that acts at the stamps, on average over the sample."""
    samples = np.arange(torque.size, dtype=np.float64)
    later = np.asarray(np.interp(samples - delay / period, samples, torque)) if delay else torque
    if timing == "measured":
        return later
    return np.asarray(0.5 * (later + np.concatenate([later[:1], later[:-1]])))


def difference(signal: FloatArray, period: float) -> FloatArray:
    """First derivative (n,) by central differences of fourth order inside, of lower order at the ends."""
    slope = np.gradient(signal, period)
    slope[2:-2] = (8.0 * (signal[3:-1] - signal[1:-3]) - (signal[4:] - signal[:-4])) / (12.0 * period)
    return slope


def second_difference(signal: FloatArray, period: float, *, timing: Timing) -> FloatArray:
    """Second derivative (n,); for a held torque the three-point one, which is exact there."""
    second = np.zeros_like(signal)
    second[1:-1] = np.diff(signal, 2) / period**2
    if timing == "measured":
        bend = np.diff(second[1:-1], 2)
        second[2:-2] -= bend / 12.0
    return second


def _banded(signal: FloatArray, weight: FloatArray, cutoff: float, period: float) -> FloatArray:
    sharp = low_pass(signal, sharp_cutoff(cutoff, period), period)
    return low_pass(sharp * weight, cutoff, period)

r"""Speed loops that hunt within a count: runs whose speed looks constant to the encoder and is not.

A speed loop on a coarse encoder kicks the link from count to count. The encoder shows a straight line, but
the link stops and goes, and its mean torque is below the friction at its mean speed, by 16 % in a simulated
case. The torque tells: over a few dozen samples its swing about its own mean carries the momentum

    P(t) = int (u - mean u) dt,

pinned to zero at both ends, and so swings the speed by about P/J. White noise of the torque sensor alone
gives P the mean square sigma^2 h^2 n / 6 over n samples h apart; the excess over that is motion. A run is
left out where it swings the speed by over half of its mean while the torque itself swings by over a fifth:
friction answers small swings of the torque without any motion. Smaller swings are reckoned with: the mean
of a curved law is not the law at the mean speed (`ident.fit.weighting`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from data.recording import FloatArray, Recording
from ident.evidence.segmentation import Stretch

SAMPLES = 50  # over which a swing is looked for
SPEED_SWING = 0.5  # of the mean speed
TORQUE_SWING = 0.2  # of the mean torque
SEEN_SWING = 0.15  # of the mean torque, from which on a swing of the speed is reckoned with


@dataclass(frozen=True)
class Swing:
    """Mean squares over short windows of a run, sensor noise included."""

    torque: float  # of u about its mean [(N m)^2]
    momentum: float  # of P [(N m s)^2]
    period: float  # h [s]


def swing(recording: Recording, window: Stretch) -> Swing:
    """The swing of the torque in a window of a log; none where it is too short to tell."""
    torque = recording.torque[window.first : window.last]
    period = recording.sample_period
    windows = torque.size // SAMPLES
    if windows < 2:
        return Swing(0.0, 0.0, period)
    pieces = torque[: windows * SAMPLES].reshape(windows, SAMPLES)
    about = pieces - pieces.mean(axis=1, keepdims=True)
    carried = np.cumsum(about, axis=1) * period
    return Swing(float(np.mean(about**2)), float(np.mean(carried**2)), period)


def sensor_noise(torques: Sequence[FloatArray]) -> float:
    """Standard deviation of the torque sensor [N m]: that of the quietest log, from differences."""
    return min(1.4826 * float(np.median(np.abs(np.diff(u)))) / float(np.sqrt(2.0)) for u in torques)


def momentum_variance(swung: Swing, *, torque: float, noise: float) -> float:
    """What the torque's swing gives the link [(N m s)^2]; 0 where it is too small to say so.

    A torque that swings little may as well follow a friction that does.
    """
    excess = swung.momentum - noise**2 * swung.period**2 * SAMPLES / 6.0
    own = swung.torque - noise**2
    return excess if excess > 0.0 and own > (SEEN_SWING * torque) ** 2 else 0.0


def hunts(swung: Swing, *, speed: float, torque: float, inertia: float, noise: float) -> bool:
    """Whether a run at a mean speed [rad/s] and torque [N m], magnitudes, is no constant speed."""
    carried = momentum_variance(swung, torque=torque, noise=noise)
    own = max(swung.torque - noise**2, 0.0)
    return carried > (SPEED_SWING * speed * inertia) ** 2 and own > (TORQUE_SWING * torque) ** 2

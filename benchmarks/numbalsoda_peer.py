"""numbalsoda, the fastest peer: LSODA in compiled code, the loop of `loop_peers` smoothed by tanh."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numba
import numpy as np
from numbalsoda import lsoda, lsoda_sig

from benchmarks.loop_peers import CURVE, GAINS, ROBOT, FloatArray, Peer

EPS: Final = 1e-9
_J, _B = ROBOT.inertia, CURVE.viscous_damping
_FC, _DF, _VS = CURVE.coulomb_torque, CURVE.stribeck_torque, CURVE.stribeck_velocity
_N1, _N2, _L = GAINS.proportional, GAINS.derivative, GAINS.observer


@numba.cfunc(lsoda_sig)
def _rate(_t, y, dy, r):  # type: ignore[no-untyped-def]  # a C callback: pointers
    x1, x2, x3 = y[0], y[1], y[2]
    v = x2 + x3
    compensated = (_FC + _DF * np.exp(-abs(x2) / _VS)) * np.tanh(x2 / EPS)
    true = (_FC + _DF * np.exp(-abs(v) / _VS)) * np.tanh(v / EPS)
    dy[0] = v
    dy[1] = -_N1 / _J * x1 - (_B + _N2) / _J * x2 + _L * x3
    dy[2] = -(_B / _J + _L) * x3 + (r[0] * compensated - true) / _J


ADDRESS: Final = _rate.address


@numba.njit(nogil=True)
def _every(address, part, parts, starts, r, times, tolerance, out):  # type: ignore[no-untyped-def]  # jitted
    for i in range(part, starts.shape[0], parts):
        gain = np.array([r[i]])
        states, _ = lsoda(address, starts[i], times, gain, tolerance, tolerance)
        out[i] = states[:, 0]


def single(times: FloatArray, *, tolerance: float) -> Peer:
    """One trajectory at `times` (k,) [s]."""

    def peer(start: FloatArray, r: float) -> FloatArray:
        states, _ = lsoda(ADDRESS, start, times, np.array([r]), rtol=tolerance, atol=tolerance)
        found: FloatArray = states[:, 0]
        return found

    return peer


def batch(
    times: FloatArray, starts: FloatArray, r: FloatArray, *, tolerance: float
) -> tuple[FloatArray, Callable[[int, int], None]]:
    """Memory (n, k) for x1 and the function of (part, parts) that fills it, without the interpreter lock."""
    out = np.empty((starts.shape[0], times.size))

    def run_part(part: int, parts: int) -> None:
        _every(ADDRESS, part, parts, starts, r, times, tolerance, out)

    return out, run_part

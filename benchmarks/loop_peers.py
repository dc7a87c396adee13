"""The closed loop of the paper in the hands of general solvers: smoothed by tanh, or cut into modes by hand.

J v' = -n1 x1 - n2 x2 + r F(x2) - b v - F(v) at L = 73.5 and the symmetric law, as in `compensation`. A peer
is a function of (start (3,), r) that gives x1 (k,) [rad] at the times asked for; each is made by a function
of those times, which raises ImportError where its package is missing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from compensation.closed_loop import ClosedLoop
from compensation.controller import Controller, Gains
from ident.model.published import symmetric_robot

FloatArray = NDArray[np.float64]
Peer = Callable[[FloatArray, float], FloatArray]

R: Final = 1.1
GAINS: Final = Gains(proportional=0.4, derivative=0.02, observer=73.5, compensation=R)
ROBOT: Final = symmetric_robot()
CURVE: Final = ROBOT.friction.positive
LOOP: Final = ClosedLoop(ROBOT, Controller(GAINS, ROBOT))
_J: Final = ROBOT.inertia
_B: Final = CURVE.viscous_damping
_FC: Final = CURVE.coulomb_torque
_DF: Final = CURVE.stribeck_torque
_VS: Final = CURVE.stribeck_velocity
_N1, _N2, _L = GAINS.proportional, GAINS.derivative, GAINS.observer


def smoothed_lsoda(times: FloatArray, *, eps: float = 1e-7, tolerance: float = 1e-8) -> Peer:
    """scipy's LSODA, sign(v) replaced by tanh(v / eps)."""

    def peer(start: FloatArray, r: float) -> FloatArray:
        def rate(_t: float, y: FloatArray) -> tuple[float, float, float]:
            x1, x2, x3 = y.tolist()
            v = x2 + x3
            compensated = (_FC + _DF * math.exp(-abs(x2) / _VS)) * math.tanh(x2 / eps)
            true = (_FC + _DF * math.exp(-abs(v) / _VS)) * math.tanh(v / eps)
            return (
                v,
                -_N1 / _J * x1 - (_B + _N2) / _J * x2 + _L * x3,
                (-(_B / _J + _L) * x3 + (r * compensated - true) / _J),
            )

        span = (times[0], times[-1])
        run = solve_ivp(rate, span, start, "LSODA", t_eval=times, rtol=tolerance, atol=tolerance)
        found: FloatArray = run.y[0]
        return found

    return peer


def _exp(exponent: float) -> float:
    """Bounded: a trial step may lead far beyond its mode."""
    return math.exp(min(exponent, 50.0))


class _Modes:
    """The sign pattern of (x2, v) and its smooth field; sticking is not foreseen: this cycle never sticks."""

    def __init__(self, r: float) -> None:
        self.r = r
        self.s2, self.sv = -1.0, -1.0

    def rate(self, _t: float, y: Any) -> tuple[float, float, float]:
        x1, x2, x3 = float(y[0]), float(y[1]), float(y[2])
        v = x2 + x3
        compensated = self.s2 * (_FC + _DF * _exp(-self.s2 * x2 / _VS))
        true = self.sv * (_FC + _DF * _exp(-self.sv * v / _VS))
        two = -_N1 / _J * x1 - (_B + _N2) / _J * x2 + _L * x3
        return v, two, -(_B / _J + _L) * x3 + (self.r * compensated - true) / _J

    def meets(self, state: FloatArray, surface: int) -> FloatArray:
        """The state put onto a surface, in the mode behind it."""
        after = state.copy()
        if surface == 0:
            after[1], self.s2 = 0.0, -self.s2
        else:
            after[2], self.sv = -after[1], -self.sv
        return after


def events_dop853(times: FloatArray, *, tolerance: float = 1e-12) -> Peer:
    """scipy's DOP853 with its events, and the mode logic by hand."""

    def reversal(_t: float, y: FloatArray) -> float:
        return float(y[1])

    def halt(_t: float, y: FloatArray) -> float:
        return float(y[1] + y[2])

    watched: list[Any] = [reversal, halt]
    for event in watched:
        event.terminal = True

    def peer(start: FloatArray, r: float) -> FloatArray:
        modes, now, state = _Modes(r), 0.0, start
        found = np.full(times.size, np.nan)
        found[0] = start[0]
        while now < times[-1]:
            reversal_side, halt_side = -modes.s2, -modes.sv
            watched[0].direction, watched[1].direction = reversal_side, halt_side
            run: Any = solve_ivp(
                modes.rate, (now, times[-1]), state, "DOP853", dense_output=True, events=watched,
                rtol=tolerance, atol=tolerance,
            )  # fmt: skip
            end = float(run.t[-1])
            inside = (times > now) & (times <= end)
            if inside.any():
                found[inside] = run.sol(times[inside])[0]
            now, state = end, run.y[:, -1]
            if run.status == 1:
                state = modes.meets(state, 0 if run.t_events[0].size else 1)
        return found

    return peer


def modes_cvode(times: FloatArray, *, tolerance: float = 1e-10) -> Peer:
    """scikit-sundae's CVODE with its root functions, and the mode logic by hand."""
    from sksundae.cvode import CVODE  # noqa: PLC0415  # a peer that may be missing

    def peer(start: FloatArray, r: float) -> FloatArray:
        modes, now, state = _Modes(r), 0.0, start

        def rate(t: float, y: FloatArray, out: FloatArray) -> None:
            out[:] = modes.rate(t, y)

        def roots(_t: float, y: FloatArray, out: FloatArray) -> None:
            out[0], out[1] = y[1], y[1] + y[2]

        events: Any = roots
        events.terminal = [True, True]
        found = np.full(times.size, np.nan)
        found[0] = start[0]
        while now < times[-1]:
            events.direction = [-int(modes.s2), -int(modes.sv)]
            solver = CVODE(
                rate, method="BDF", rtol=tolerance, atol=tolerance, eventsfn=events, num_events=2,
                max_num_steps=100_000,
            )  # fmt: skip
            ahead = times[times > now + 1e-12]
            run = solver.solve(np.concatenate([[now], ahead]), state)
            reached = min(float(run.t[-1]), float(times[-1]))
            at_output = np.searchsorted(run.t, times)
            for index in np.flatnonzero((times > now) & (times <= reached)):
                found[index] = run.y[min(int(at_output[index]), run.t.size - 1), 0]
            now, state = reached, run.y[-1]
            met = np.asarray(run.i_events) if run.i_events is not None else np.zeros((0, 2))
            if now < times[-1]:
                state = modes.meets(state, 0 if met[-1][0] != 0 else 1)
        return found

    return peer


def smoothed_diffrax(times: FloatArray, *, eps: float = 1e-5, tolerance: float = 1e-8) -> Peer:
    """diffrax's Kvaerno5 in double precision, smoothed."""
    import diffrax  # noqa: PLC0415  # a peer that may be missing
    import jax  # noqa: PLC0415
    import jax.numpy as jnp  # noqa: PLC0415

    config: Any = jax.config
    config.update("jax_enable_x64", True)

    def rate(_t: Any, y: Any, r: Any) -> Any:
        x1, x2, x3 = y
        v = x2 + x3
        compensated = (_FC + _DF * jnp.exp(-jnp.abs(x2) / _VS)) * jnp.tanh(x2 / eps)
        true = (_FC + _DF * jnp.exp(-jnp.abs(v) / _VS)) * jnp.tanh(v / eps)
        return jnp.stack(
            [
                v,
                -_N1 / _J * x1 - (_B + _N2) / _J * x2 + _L * x3,
                -(_B / _J + _L) * x3 + (r * compensated - true) / _J,
            ]
        )

    @cast("Callable[[Any], Any]", jax.jit)
    def solve(start: Any, r: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(rate), diffrax.Kvaerno5(), times[0], times[-1], 1e-4, start, args=r,
            saveat=diffrax.SaveAt(ts=times), max_steps=2_000_000,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
        ).ys[:, 0]  # fmt: skip

    def peer(start: FloatArray, r: float) -> FloatArray:
        return np.asarray(solve(start, r))

    return peer

"""Hypothesis strategies: admissible laws, robots and gains."""

from __future__ import annotations

from hypothesis import strategies as st

from compensation.controller import Controller, Gains
from ident.model.friction import StribeckCurve, StribeckFriction
from ident.model.robot import OneLinkRobot


@st.composite
def stribeck_curves(draw: st.DrawFn, shapes: st.SearchStrategy[float] | None = None) -> StribeckCurve:
    """Curves within a decade or so of Table 1; beta in [0.5, 2] unless told otherwise."""
    coulomb = draw(st.floats(0.05, 1.0))
    return StribeckCurve(
        static_torque=coulomb + draw(st.floats(0.0, 0.5)),
        coulomb_torque=coulomb,
        stribeck_velocity=draw(st.floats(0.01, 0.5)),
        viscous_damping=draw(st.floats(0.0, 0.3)),
        stribeck_shape=draw(shapes if shapes is not None else st.floats(0.5, 2.0)),
    )


@st.composite
def robots(draw: st.DrawFn, shapes: st.SearchStrategy[float] | None = None) -> OneLinkRobot:
    """Asymmetric robots."""
    friction = StribeckFriction(draw(stribeck_curves(shapes)), draw(stribeck_curves(shapes)))
    return OneLinkRobot(draw(st.floats(0.005, 0.2)), friction)


@st.composite
def gains(draw: st.DrawFn) -> Gains:
    """Gains around the paper's: L on both sides of critical, r from 0 to 2."""
    return Gains(
        proportional=draw(st.floats(0.1, 2.0)),
        derivative=draw(st.floats(0.0, 0.2)),
        observer=draw(st.floats(5.0, 200.0)),
        compensation=draw(st.floats(0.0, 2.0)),
    )


@st.composite
def controllers(draw: st.DrawFn, shapes: st.SearchStrategy[float] | None = None) -> Controller:
    """Controllers that believe in a robot of their own."""
    return Controller(draw(gains()), draw(robots(shapes)))

"""Small results to draw: the paper's robot, a handful of points, runs and branches."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from compensation.bifurcation import Bifurcation, Branch, Diagram, Point
from compensation.controller import Gains
from ident.evidence.friction_map import MapPoint
from ident.model import published
from ident.simulation.trajectory import Marks, Trajectory

HOSTILE: Final = "<script>alert(1)</script>&\"'=cmd()\x1b[31m\u202e$x_1${{ 7 * 7 }}-->"


def map_points() -> list[MapPoint]:
    """Three speeds and a breakaway in each direction; the slowest run of each was left out."""
    friction = published.asymmetric_robot().friction
    return [
        MapPoint(
            log=f"{HOSTILE}{sign * speed:+g}",
            protocol="breakaway" if speed == 0 else "constant_velocity",
            direction=sign,
            velocity=sign * speed,
            torque=sign * float(curve.total(speed)),
            fitted=None if speed == 0.006 else sign * float(curve.total(speed)),
            stderr=0.003,
            velocity_stderr=None,
            ramp_rate=None,
            start_time=0.0,
            end_time=1.0,
            used=speed != 0.006,
            why="E-STICKSLIP" if speed == 0.006 else None,
        )
        for sign, curve in ((1, friction.positive), (-1, friction.negative))
        for speed in (0.0, 0.006, 0.05, 1.5)
    ]


def motion() -> Trajectory:
    """A decaying oscillation."""
    time = np.linspace(0.0, 5.0, 200)
    state = np.exp(-time)[:, None] * np.column_stack((np.cos(3 * time), -np.sin(3 * time), 0.1 * time))
    none = Marks(np.empty(0), np.empty(0, np.int64), np.empty((0, 3)), ())
    return Trajectory(time, state, none, "time reached", 5.0, state[-1])


def diagram() -> Diagram:
    """A set below r = 1, a cycle and an unstable point above."""
    below, above = np.linspace(0.8, 1.0, 5), np.linspace(1.0, 1.3, 7)
    rests = tuple(Point(r, r - 1, 1 - r, 1 - r) for r in map(float, below))
    cycles = tuple(Point(r, 1 - r, r - 1, r - 1, period=6.0) for r in map(float, above))
    unstable = tuple(Point(r, 0.0, 0.0, 0.0) for r in map(float, above))
    return Diagram(
        "r",
        Gains(0.4, 0.02, 73.5, 1.0),
        (
            Branch("equilibrium_set", True, rests),
            Branch("limit_cycle", True, cycles),
            Branch("equilibrium", False, unstable),
        ),
        (Bifurcation(1.0, "equilibrium_set_to_limit_cycle"),),
    )


def comparison(log: str = "run.mcap") -> dict[str, Any]:
    """Two starts over five gains; one run is undecided, one onset has no lower end."""
    runs = []
    for start in (0.6, -0.1):
        for r in (0.8, 0.9, 1.0, 1.1, 1.2):
            rests = r < 1.0
            seen: dict[str, Any] = {
                "verdict": "equilibrium" if rests else "limit_cycle",
                "position_error": 0.2 if rests else None,
                "amplitude": None if rests else r - 0.9,
                "x1_min": 0.2 if rests else 0.9 - r,
                "x1_max": 0.2 if rests else r - 0.9,
                "period": None if rests else 6.0,
            }
            runs.append({"log": f"{r:.2f}{log}", "r": r, "start": start, **seen, "predicted": dict(seen)})
    runs[2]["verdict"] = "undecided"
    onset = [
        {"start": 0.6, "gains": {"observer_gain": 73.5}, "recorded": [0.9, 1.1], "predicted": 0.995,
         "predicted_interval95": [0.99, 1.0], "ideal": 0.993, "symmetric": 1.0, "reversals": [1.15]},
        {"start": -0.1, "gains": {"observer_gain": 73.5}, "recorded": [None, 1.0], "predicted": None,
         "predicted_interval95": [], "ideal": None, "symmetric": 1.0, "reversals": [], "why": "no rest"},
    ]  # fmt: skip
    return {"runs": runs, "onset": onset, "agreement": {"verdicts": 1.0, "amplitude_rms": 0.004}}


def estimate(value: float, unit: str, relative: float = 0.01) -> dict[str, Any]:
    """An entry of robot.json."""
    ends = [value * (1 - 2 * relative), value * (1 + 2 * relative)]
    return {"value": value, "stderr": value * relative, "interval95": ends, "unit": unit,
            "withheld": None, "fixed": False}  # fmt: skip


def robot(log: str = "velocity/p0.10.csv") -> dict[str, Any]:
    """robot.json of a fit that found the paper's values, but no Stribeck velocity in one direction."""
    curves = {"positive": published.POSITIVE, "negative": published.NEGATIVE,
              "mean": published.symmetric_robot().friction.positive}  # fmt: skip
    document: dict[str, Any] = {
        name: {
            "static_torque": estimate(curve.static_torque, "N m"),
            "coulomb_torque": estimate(curve.coulomb_torque, "N m"),
            "stribeck_velocity": estimate(curve.stribeck_velocity, "rad/s"),
            "stribeck_shape": {"value": 1.0, "stderr": None, "interval95": None, "unit": "1",
                               "withheld": None, "fixed": True},
            "viscous_damping": estimate(curve.viscous_damping, "N m s/rad"),
        }
        for name, curve in curves.items()
    }  # fmt: skip
    for name in ("negative", "mean"):
        document[name]["stribeck_velocity"] = {
            "value": None, "unit": "rad/s", "withheld": f"E-LOWSPEED: run 0.01 to 0.05 rad/s {HOSTILE}",
        }  # fmt: skip
    document["positive"]["static_torque"]["interval95"] = [0.55, None]
    return {
        "schema": "stribeck/robot/1", "axis": "rotary", "simulated": False,
        "inertia": estimate(published.INERTIA, "kg m^2"), **document,
        "torque_offset": {"value": None, "unit": "N m", "withheld": "not separable"},
        "inertia_sources": {"frequency_response": estimate(0.026, "kg m^2")},
        "breakaways": [
            {"direction": "positive", "used": 6, "censored": 1, "torque": [0.57, 0.58], "spread": 0.004,
             "ramp_rates": [0.05, 0.2], "places": [-1.0, 2.0]},
            {"direction": "negative", "used": 0, "censored": 0, "torque": None, "spread": None,
             "ramp_rates": None, "places": None},
        ],
        "validation": {"held_out": held_out(log), "ramps": [
            {"log": log, "direction": 1, "onset_time": 3.2, "onset_error": -0.02, "travel": 1.5,
             "position_rms": 0.003, "counts_rms": 125.0},
        ]},
        "runs": [
            {"log": log, "sha256": "ab" * 32, "protocol": "constant_velocity", "used": True, "why": None},
            {"log": "slow.csv", "sha256": "cd" * 32, "protocol": "constant_velocity", "used": False,
             "why": f"E-STICKSLIP {log}"},
        ],
        "notes": [
            {"code": "E-OFFSET", "severity": "warn", "text": f"seen {log}", "log": None},
            {"code": "E-STICKSLIP", "severity": "withhold", "text": "left out", "log": log},
        ],
    }  # fmt: skip


def held_out(log: str = "velocity/p0.10.csv") -> dict[str, Any]:
    """A breakaway and two speeds in each direction, one of them far from its prediction."""
    points = [
        {"log": log, "protocol": "constant_velocity" if speed else "breakaway", "direction": sign,
         "velocity": sign * speed, "place": 0.3 * sign, "measured": sign * 0.5, "predicted": sign * 0.49,
         "stderr": 0.01, "standardised": 4.2 if sign * speed == 1.5 else 1.0}
        for sign in (1, -1)
        for speed in (0.0, 0.05, 1.5)
    ]  # fmt: skip
    tests = [{"name": "trend with place", "statistic": 0.2, "expected": 0.0, "chance": 0.6, "data": 6}]
    return {"predicted": 6, "folds": 3, "torque_rms": 0.01, "standardised_rms": 1.9, "inside95": 5,
            "within": 2.1, "tests": tests, "points": points}  # fmt: skip


def truth() -> dict[str, Any]:
    """truth.json of a virtual rig with the paper's robot."""
    names = ("static_torque", "coulomb_torque", "stribeck_velocity", "stribeck_shape", "viscous_damping")
    sides = {"positive": published.POSITIVE, "negative": published.NEGATIVE}
    return {"inertia": published.INERTIA, **{
        side: {name: getattr(curve, name) for name in names} for side, curve in sides.items()
    }}  # fmt: skip


def design() -> dict[str, Any]:
    """design.json, with one number withheld."""
    gain = {"value": 94.37, "unit": "1/s", "interval95": [92.0, 97.0], "withheld": None}
    return {
        "critical_observer_gain": {
            "positive": gain, "worst": gain, "mean": dict(gain, value=73.07),
            "negative": {"value": None, "unit": "1/s", "interval95": None, "withheld": f"v_s {HOSTILE}"},
        },
        "rests_beside_the_cycle": {
            side: dict(gain, value=r, unit="1", interval95=[r - 0.01, r + 0.01])
            for side, r in (("positive", 1.0564), ("negative", 0.9436), ("r_max", 1.0564))
        },
        "decay_rate": {"observer_error": dict(gain, value=-20.9), "loop": dict(gain, value=1.94)},
        "certificates": [
            {"robot": "both directions", "law": "mean", "hypothesis": "r = 1", "holds": True, "margin": 0.0,
             "unit": "1", "says": HOSTILE},
        ],
        "recommended": {"observer_gain": 104.2, "compensation_gain": 0.94, "compensator": "per-direction",
                        "largest_rest_error": 0.1, "why": "because", "alternatives": []},
    }  # fmt: skip

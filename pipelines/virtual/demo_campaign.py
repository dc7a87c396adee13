"""The demo's campaign.toml: the virtual rig's whole campaign, and an example to start one's own file from."""

from __future__ import annotations

from typing import Final

_FULL: Final = {
    "speeds": ("[0.005, 0.008, 0.013, 0.021, 0.034, 0.055, 0.088, 0.14, 0.23, 0.37, 0.59, 0.96, 1.55, 2.5]"),
    "realisations": "6",
    "ramps": "6",
    "gains": "[0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 1.0, 1.01, 1.02, 1.05, 1.1, 1.2, 1.3]",
    "starts": "[0.6, -0.6, -0.1]",
}
_QUICK: Final = {
    "speeds": "[0.005, 0.012, 0.03, 0.07, 0.17, 0.4, 1.0, 2.5]",
    "realisations": "4",
    "ramps": "4",
    "gains": "[0.8, 0.95, 0.98, 0.99, 1.0, 1.02, 1.1, 1.3]",
    "starts": "[0.6, -0.1]",
}

_TEXT: Final = """\
# A campaign says what was recorded on a rig and how its logs name things. This one was recorded by the
# virtual rig of the last table, so the true friction is known: it stands in truth.json. For a rig of your
# own, keep the tables down to the last [[experiment]], change them to what your logs hold, and leave
# [virtual_rig] out.

[rig]
name = "virtual one-link robot"
encoder_counts = 262144     # counts a revolution, 2^18; left out, it is estimated from the logs
axis = "rotary"             # or "linear": m, N, kg, N s/m stand where rad, N m, kg m^2, N m s/rad do

# Where each signal stands in a CSV log (its header) and in an MCAP log (topic:field), and the unit it is
# logged in where that is not SI. A motor current is a torque with unit = "A", scale = 0.12 (its N m/A),
# and sign = -1 if it is wired the other way round.
[signals]
time     = { csv = "t" }                            # MCAP logs carry stamps
position = { csv = "q_deg", mcap = "/joint_states:position[0]", unit = { csv = "deg", mcap = "rad" } }
torque   = { csv = "u", mcap = "/joint_states:effort[0]", unit = "N m" }

# Torque ramped from rest until the link breaks away: the static torque F_s, and the inertia from the motion
# after it.
[[experiment]]
protocol = "breakaway"
logs = ["breakaway/*.mcap"]

# Constant speeds in both directions, from well below the Stribeck velocity to well above it: F_c, v_s and b.
[[experiment]]
protocol = "constant_velocity"
logs = ["velocity/*.csv"]

# A multisine torque on a speed far above the Stribeck velocity, where friction is nearly a straight line:
# the inertia J.
[[experiment]]
protocol = "frequency_response"
logs = ["multisine/*.mcap"]

# The closed loop that the friction law is for. Nothing is fitted to these runs: predictions are held against
# them.
[[experiment]]
protocol = "set_point"
logs = ["set_point/*.mcap"]
proportional_gain = 0.4     # n1 [N m/rad]
derivative_gain   = 0.02    # n2 [N m s/rad]
observer_gain     = 73.5    # L [1/s]
compensation_gain = "metadata:r"    # r stands in each log's metadata
sample_period     = 0.001   # s
observer_update   = "euler" # how the controller steps its observer
delay             = 0       # samples between measuring and acting

[experiment.compensator]    # the model that the rig's controller carried: Table 1's unrounded means
static_torque = 0.5429
coulomb_torque = 0.39385
stribeck_velocity = 0.07525
viscous_damping = 0.0809
inertia = 0.026             # of its observer

# The truth, and what to play on it: only for `stribeck record` and `stribeck demo`. Friction as in Table 1 of
# van de Wouw, Mallon and Nijmeijer (2004), each direction its own.
[virtual_rig]
sample_period = 0.001       # s
torque_noise  = 0.01        # standard deviation of the torque channel [N m]
ripple        = { amplitude = 0.005, harmonic = 12 }   # torque over position: part of F_c, periods a turn
ramp_rates    = [0.1, 0.3]  # N m/s, each in both directions
ramps         = <ramps>           # in a log, each from where the last one came to rest
speeds        = <speeds>  # rad/s
compensation_gains = <gains>
starts        = <starts>   # rad; "the onset" of limit cycling is a statement about a start
duration      = 30.0        # s, of a set-point run
seed          = 1

[virtual_rig.robot]
inertia = 0.026             # kg m^2

[virtual_rig.robot.positive]
static_torque = 0.5735      # F_s [N m]
coulomb_torque = 0.3990     # F_c [N m]
stribeck_velocity = 0.0688  # v_s [rad/s]
viscous_damping = 0.0828    # b [N m s/rad]

[virtual_rig.robot.negative]
static_torque = 0.5123
coulomb_torque = 0.3887
stribeck_velocity = 0.0817
viscous_damping = 0.0790

[virtual_rig.multisine]
bias = 3.0                  # rad/s
lowest = 1.0                # Hz
highest = 40.0              # Hz
realisations = <realisations>            # logs, each with other phases: their spread is the error
"""


def demo_campaign_text(quick: bool) -> str:
    """The demo's campaign.toml; `quick` has fewer speeds, gains and starts, still identifying everything."""
    text = _TEXT
    for key, value in (_QUICK if quick else _FULL).items():
        text = text.replace(f"<{key}>", value)
    return text

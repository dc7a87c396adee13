"""What was measured.

A rig leaves log files. This room reads them, proves what can be proved of them, and hands on a
`Recording`: one run's time, position and torque in SI units, in the rig's own sign convention, together
with what was asked of the rig (its `Protocol`) and where it came from.

Conventions, used everywhere: position q [rad] (or [m]), velocity [rad/s], torque u [N m] as commanded to
the motor, positive torque accelerates towards positive q. Units are converted once, at the file door.
This room imports nothing of ours.
"""

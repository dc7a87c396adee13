"""Where trajectories end up: equilibria, limit cycles, their stability and their branches.

Nothing here knows a robot.
"""

"""Time [s] of the first calls in a process without a compilation cache: `python -m benchmarks.first_call`.

The first number is one trajectory, import included, the second every kernel of trajectories and diagrams.
"""

from __future__ import annotations

import time
from dataclasses import replace


def main() -> None:
    """Print both."""
    begun = time.perf_counter()
    from benchmarks.loop_peers import CURVE, GAINS, LOOP, ROBOT  # noqa: PLC0415  # imports are timed too
    from compensation.bifurcation import diagram  # noqa: PLC0415
    from compensation.closed_loop import ClosedLoop, simulate  # noqa: PLC0415
    from compensation.controller import Controller  # noqa: PLC0415
    from compensation.many_trajectories import simulate_many  # noqa: PLC0415
    from ident.model.friction import StribeckFriction  # noqa: PLC0415

    simulate(LOOP, (1.0, 0.0, 0.0), duration=1.0)
    print(time.perf_counter() - begun)
    bent = replace(ROBOT, friction=StribeckFriction.symmetric(replace(CURVE, stribeck_shape=1.5)))
    simulate(ClosedLoop(bent, Controller(GAINS, bent)), (1.0, 0.0, 0.0), duration=1.0)
    diagram(LOOP, "r", [1.0, 1.1])
    simulate_many(LOOP, [(1.0, 0.0, 0.0)], duration=1.0)
    print(time.perf_counter() - begun)


if __name__ == "__main__":
    main()

"""What law explains it.

Recordings become points of a friction map, and the map becomes a robot: its inertia J and, for each
direction of motion, the five numbers of a Stribeck curve, each with an interval, or withheld with a
reason. `ident.model` is the language that everything after this room speaks; `ident.simulation` is how a
discontinuous system moves, and knows no robot.
"""

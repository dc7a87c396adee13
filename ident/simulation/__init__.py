"""How a law moves: numerics of Filippov systems that know no robot.

A system is given by modes, each with a vector field and the switching functions that end it. Integration
goes from event to event, and says why it ended.
"""

"""The shared language: the friction law, the robot, and the numbers that were published.

Symbols follow van de Wouw, Mallon and Nijmeijer (2004): J inertia, b viscous damping, F_s static and F_c
Coulomb friction, dF = F_s - F_c, v_s Stribeck velocity, beta Stribeck shape. Torques of a law are
magnitudes, positive in both directions of motion.
"""

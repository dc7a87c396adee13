"""What the loop will do.

The robot (the true law) and the controller (gains, and the law that it believes) make a closed loop,
inclusion (8) of van de Wouw, Mallon and Nijmeijer (2004). Its states are x1 = q - q_r [rad], x2 the
observer's velocity estimate [rad/s] and x3 = dq/dt - x2 the observer error [rad/s]; v = x2 + x3 is the
true velocity. True friction and compensated friction are two values, everywhere.
"""

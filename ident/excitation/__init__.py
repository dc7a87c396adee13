"""What any motion under known torque says: J, b, F_c, and the whole law where the motion shows it.

    u = J a + F_c sign(v) + dF exp(-|v|/v_s) sign(v) + b v + c

An excitation is a motion that nobody arranged for one parameter: a robot at its work, a chirp, a program of
trapezes under a position loop. Its torque is explained by least squares in a band of frequencies (inverse
dynamics), its positions by simulation over short windows (output error). From such motion alone a law for
each direction and an offset c cannot both be had: it is one law with an offset, or a law for each without.
"""

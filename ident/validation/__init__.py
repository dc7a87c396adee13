"""Prediction against measurement, on runs that the fit has not seen.

A fit that passes through its own data proves little. Here runs are left out in turn, the rest is fitted with
the weights kept, and what was left out is predicted with the prediction's own error: that of the law's
parameters and that of the run (`held_out`). Whether the errors are as large as they should be, and without
a trend, is said by tests that need no normality (`ident.fit.residual_tests`). The motion after each breakaway
is a trajectory that the law, fitted without that log, has to follow (`ramp_motion`).
"""

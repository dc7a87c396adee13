"""What goes wrong with a measurement before anyone estimates from it: refuse, mend or warn, and say why.

Each detector here sees one run in SI and answers with findings, with mended signals, or with a refusal
(`LogError`) that names the sample, the time, the parameter harmed and the remedy. Nothing that could be good
data is altered: only a wrap whose other side fits, and single samples that leave the path and come back.

    E-CLOCK  time does not advance                    late samples sorted in, wrong stamps left out, the run
                                                      taken apart where the clock was set back; refused where
                                                      too little is left, or time leaps years
    E-WRAP   the encoder wraps                        unwrapped where unambiguous, else refused
    E-SPIKE  single wrong positions                   dropped and counted; refused above 1 %
    E-GAP    lost samples, jitter                     warned; no derivative is taken across a gap
    E-SAT    the torque sits at its limit             warned
    E-UNIT   logged velocity is not dq/dt             refused, with the factor and the unit it looks like
    E-SIGN   the torque takes work out of the link    refused

`screen.screen` is the door; `run.Run` is what it sees.
"""

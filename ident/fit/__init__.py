"""Which law explains the evidence, how certain it is, and what it does not tell.

The evidence is weighed (`weighting`, `variance_model`), fitted in one stage (`friction_fit`), asked whether
its law has a Stribeck effect and which shape, and handed on as parameters with intervals or reasons why there
are none.
"""

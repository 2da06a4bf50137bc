"""Linear analysis of the loop: models, measured responses, margins.

linear      rational transfer functions: poles, margins, bandwidth, responses
rigid       the paper's loops, eqs. (4) and (5), on a rigid axis
two_mass    the same loops on motor - spring - load
profiles    closed forms of move times
"""

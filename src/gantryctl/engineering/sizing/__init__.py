"""Sizing: from a requirement sheet to the motors that fit, and on to the limits of a machine file.

`equations` holds the paper's equations (1) to (3), `train` what they leave out, `duty` the day of work, `checks` what
a motor must meet, `chain` the machine file that follows.
"""

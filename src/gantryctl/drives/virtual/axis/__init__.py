"""Behind the virtual drive's objects: CiA 402 states, power stage, set-point, motor and gantry."""

"""Beside the bus: faults switched on from a test, the truth read back, clock steps."""

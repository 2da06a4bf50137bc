"""Monitors of the axis, interlocks, recovery and the record of a stop."""

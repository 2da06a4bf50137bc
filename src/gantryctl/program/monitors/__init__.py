"""Monitors of the axis, interlocks, and what a stop was like."""

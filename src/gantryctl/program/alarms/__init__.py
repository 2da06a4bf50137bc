"""Alarms and refusals: codes, definitions, the log of an axis."""

"""Frames of a bus: the latest in memory, log files of python-can, and what is frozen with an alarm."""

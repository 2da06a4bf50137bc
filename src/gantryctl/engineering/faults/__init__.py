"""Faults as data: injected on every seam of a simulated axis, watched on the true plant, judged, listed.

A controller imports nothing of this: on a real bus the injection is absent, not switched off.
"""

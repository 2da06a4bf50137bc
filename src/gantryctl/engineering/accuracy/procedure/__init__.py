"""Chord procedures as stop points, and running them on the batch or on the scan engine."""

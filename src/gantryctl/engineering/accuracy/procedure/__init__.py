"""Chord procedures as stop points, and their drivers on the batch and on the scan engine."""

"""Frames of a CANopen bus in words: what each one is, and the objects in it with their units."""

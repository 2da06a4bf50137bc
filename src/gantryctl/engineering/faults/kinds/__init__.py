"""Kinds of faults, by what they act on."""

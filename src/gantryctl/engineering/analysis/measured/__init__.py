"""Frequency responses measured on an axis, and the excitation for them."""

"""Drives: each a `Drive` port, strangers to each other."""

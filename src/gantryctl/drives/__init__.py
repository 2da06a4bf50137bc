"""Drives: each behind the `Drive` port, strangers to each other."""

"""Benchmarks: how fast the parts are on this computer, each beside others in the same run."""

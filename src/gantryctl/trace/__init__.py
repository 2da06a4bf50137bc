"""Recordings: column names, `Trace`, reading and exporting."""

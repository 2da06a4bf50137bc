"""Rows of the catalogue, a file for each group."""

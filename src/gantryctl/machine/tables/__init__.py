"""The tables of a machine file as immutable types with units, ranges and defaults."""

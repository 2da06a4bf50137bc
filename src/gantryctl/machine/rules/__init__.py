"""What keys of a machine file demand of each other, one rule a function."""

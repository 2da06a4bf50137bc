"""The fastest profile of a move."""

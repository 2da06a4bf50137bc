"""The axis: its states, its commands and the position loop of one scan."""

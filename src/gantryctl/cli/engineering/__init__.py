"""Commands that size, analyse, tune, identify and prove an axis in simulation."""

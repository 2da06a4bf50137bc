"""Power: the way up and down, stops, holding torque, brake test."""

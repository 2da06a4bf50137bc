"""Control, simulation and accuracy proof of a proton-therapy gantry's rotation axis."""

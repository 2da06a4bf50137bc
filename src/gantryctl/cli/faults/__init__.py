"""`gantryctl faults`: one fault, and campaigns of them."""

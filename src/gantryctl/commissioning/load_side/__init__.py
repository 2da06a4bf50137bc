"""Steps that look at the load: the encoder on the ring, and the chord test by an instrument."""

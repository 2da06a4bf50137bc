"""Linear models: rigid, two masses, sampled, the whole loop, and what follows from them."""

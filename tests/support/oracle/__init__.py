"""The oracle: watches the true plant and the wire in every test, and holds the invariants INV-1 to INV-7."""

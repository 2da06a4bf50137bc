"""The oracle: watches the true plant and the wire, in campaigns and in every test, and holds INV-1 to INV-7."""

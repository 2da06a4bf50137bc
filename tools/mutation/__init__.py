"""The power of the tests: bugs planted in the sources, and which test finds each (docs/decisions/0028)."""

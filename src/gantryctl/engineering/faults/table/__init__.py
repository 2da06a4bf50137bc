"""The fault catalogue as a table: every fault, what detects it, what is done, and the tests that inject it."""

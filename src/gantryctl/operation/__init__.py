"""One machine in operation: opening and closing, one run of its axis, and its state between runs."""

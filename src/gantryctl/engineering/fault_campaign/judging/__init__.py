"""What is demanded of a scenario beyond the oracle."""

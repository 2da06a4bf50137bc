"""The operator page in a browser."""

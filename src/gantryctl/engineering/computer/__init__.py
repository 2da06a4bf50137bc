"""This computer: whether it keeps the time that a scan needs."""

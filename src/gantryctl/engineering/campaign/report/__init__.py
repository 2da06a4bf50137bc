"""A population as tables, JSON, figures and one HTML page."""

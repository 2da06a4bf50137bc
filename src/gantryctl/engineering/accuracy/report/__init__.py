"""The accuracy report as data, text, figures and one HTML file."""

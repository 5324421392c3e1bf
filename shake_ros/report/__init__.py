"""Figures and the HTML page, from the results alone."""

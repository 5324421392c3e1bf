"""Harmonics that a real table left behind in print (tables 6.1 and 6.2), against printed and fitted models."""

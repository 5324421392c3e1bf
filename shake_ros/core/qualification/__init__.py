"""Seismic qualification: required spectra, motions that meet them, and the rules by which a test is judged."""

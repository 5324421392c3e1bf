"""Signals: spectra, harmonics, frequency responses."""

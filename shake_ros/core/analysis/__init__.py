"""Signals: spectra, harmonics, differentiation."""

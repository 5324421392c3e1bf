"""Seismic qualification: required spectra, motions that meet them, the rules that assess them, and the certificate."""

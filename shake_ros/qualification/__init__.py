"""Seismic qualification: required spectra, motions that meet them, the rules that judge, and the certificate."""

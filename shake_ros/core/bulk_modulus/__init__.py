"""Bulk modulus of the oil and what the chambers see of it: one file per published law."""

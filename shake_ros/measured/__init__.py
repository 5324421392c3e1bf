"""Printed harmonics of a real table (tables 6.1 and 6.2), against printed and fitted models."""

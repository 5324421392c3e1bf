"""Qualification tests on the simulated table, and the parts they are made of against the field's own."""

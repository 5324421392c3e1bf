"""Servo-valve: spool dynamics and port flows."""

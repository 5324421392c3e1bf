"""A new table brought into service: gentle motion, model, gains, a higher level, each step released."""

"""What a model leaves: how much of it is predictable, on what it depends, the missing force, what to record next."""

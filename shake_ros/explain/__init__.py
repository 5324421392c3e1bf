"""What a model leaves: how much of it is predictable, on what it depends, the force that is missing."""

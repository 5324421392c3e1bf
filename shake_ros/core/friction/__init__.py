"""Friction of cylinder and guides: one file per published law, force opposing velocity."""

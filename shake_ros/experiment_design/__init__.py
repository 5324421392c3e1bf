"""Slice: the motion that tells rival models apart; how it is chosen, written, played, and decided upon."""

"""A motion played again and again: the drive, or the model, of each run corrected by what the last one missed."""

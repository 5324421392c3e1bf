"""Drive-file iteration: a motion played again and again, the drive or the model corrected by each run."""

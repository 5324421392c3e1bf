"""What differs from recording to recording and is not the table's: offsets, sensors, glitches, noise."""

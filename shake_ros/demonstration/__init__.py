"""The main job end to end, over DDS and on measured data."""

"""What stands between a program and the oil: stages of the hydraulics, causes, checks of the sensors."""

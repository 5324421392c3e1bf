"""Physics and mathematics: numpy, scipy and numba only; no ROS, no files, no plotting, no clock."""

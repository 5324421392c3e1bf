"""Studies of many independent tasks, on this machine's cores or on a cluster: the same rows, to the last bit."""

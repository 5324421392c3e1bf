"""One file per offline command: arguments, calls, exit code."""

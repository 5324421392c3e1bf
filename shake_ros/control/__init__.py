"""Laws, observers and references; the closed loop that they make, what it is judged by, and on which tables."""

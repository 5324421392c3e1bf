"""The closed loop as one compiled function, what it is judged by, and the tables on which it is judged."""

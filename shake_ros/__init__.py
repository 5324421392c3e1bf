"""Servo-hydraulic shaking table: simulation, control and identification as a ROS 2 node graph."""

__version__ = "0.1.0"

"""The link to a target computer by datagrams: wire format, session, channels, clock, both ends. No ROS in here."""

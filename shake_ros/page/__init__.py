"""The live page without ROS: samples, frames, sessions, server, jobs, library. The node `page` feeds it."""

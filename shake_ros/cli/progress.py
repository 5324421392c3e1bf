"""The progress bar of the commands."""

from shake_ros.api.progress import Progress as Bar

__all__ = ["Bar"]

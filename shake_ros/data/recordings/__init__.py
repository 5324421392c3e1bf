"""Recordings of shaking tables: rosbag2 folders and files, read on one time base and written."""

from shake_ros.data.recordings.bag import Finding
from shake_ros.data.recordings.publishers import Take
from shake_ros.data.recordings.table import Provenance, TableRecording, read_table_recording
from shake_ros.data.recordings.table_writer import write_table_recording
from shake_ros.data.recordings.writer import BagWriter, recover

__all__ = [
    "BagWriter",
    "Finding",
    "Provenance",
    "TableRecording",
    "Take",
    "read_table_recording",
    "recover",
    "write_table_recording",
]

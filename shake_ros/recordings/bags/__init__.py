"""Recordings of shaking tables: rosbag2 folders and files, read on one time base and written."""

from shake_ros.recordings.bags.bag import Finding
from shake_ros.recordings.bags.publishers import Take
from shake_ros.recordings.bags.table import Provenance, TableRecording, read_table_recording
from shake_ros.recordings.bags.table_writer import write_table_recording
from shake_ros.recordings.bags.writer import BagWriter, recover

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

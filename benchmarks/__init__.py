"""Benchmarks by subject, run from the repository's root: `python -m benchmarks.SUBJECT.NAME`.

NAME.txt beside a benchmark holds its last figures. What tests and benchmarks share lies here too: the table written a
second time, tables with hidden effects, and the nodes that listen to and drive a graph.
"""

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

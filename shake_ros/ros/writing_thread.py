"""The thread that takes messages off a queue and writes them, so that no callback waits for a disk."""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shake_ros.data.recordings import BagWriter

PAUSE = 0.02  # between two looks at the queue [s]
BURST = 500  # messages written before other threads get a turn


@dataclass(frozen=True)
class Declaration:
    """A topic as a recording declares it: full name, type, offered quality of service in rosbag2's form."""

    name: str
    type: str
    profiles: list[dict[str, Any]]


class WritingThread:
    """Writes what `put` appends; all calls of the writer happen in this thread.

    Parameters
    ----------
    writer : recording, just made.
    flush_every : everything is handed to the operating system at least this often [s].
    limit : of the bytes that wait; what comes beyond is counted as dropped.

    Attributes
    ----------
    waiting : bytes in the queue.
    dropped : messages that found no room.
    error : why writing ended, empty while it goes well.
    """

    def __init__(self, writer: BagWriter, flush_every: float, limit: int) -> None:
        self.path: Path = writer.path
        self.waiting = 0
        self.dropped = 0
        self.error = ""
        self._writer = writer
        self._flush_every = flush_every
        self._limit = limit
        self._queue: deque[tuple[int, int, bytes]] = deque()
        self._declared: dict[int, Declaration] = {}
        self._numbers: dict[int, int] = {}
        self._added = 0  # bytes ever put, by the callbacks' thread
        self._written = 0  # bytes ever written, by this thread
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    def declare(self, topic: int, declaration: Declaration) -> None:
        """Say what a topic is, before its first message."""
        self._declared[topic] = declaration

    def put(self, topic: int, received: int, data: bytes) -> None:
        """Append a message with its time of receipt [ns]; never waits."""
        self.waiting = self._added - self._written
        if self.waiting > self._limit or self.error:
            self.dropped += 1
            return
        self._added += len(data)
        self._queue.append((topic, received, data))

    def close(self) -> str:
        """Write what is left and complete the recording; returns the error, empty where all went well."""
        self._closing.set()
        self._thread.join()
        return self.error

    def _run(self) -> None:
        try:
            flushed = time.monotonic()
            while not self._closing.is_set():
                self._closing.wait(PAUSE)
                self._drain()
                if time.monotonic() - flushed >= self._flush_every - PAUSE:
                    flushed = time.monotonic()
                    self._writer.flush()
            self._drain()
            self._writer.close()
        except OSError as error:
            self.error = error.strerror or str(error)
            self._queue.clear()

    def _drain(self) -> None:
        queue, numbers, write = self._queue, self._numbers, self._writer.write
        while queue:
            for _ in range(min(BURST, len(queue))):
                topic, received, data = queue.popleft()
                if topic not in numbers:
                    declared = self._declared[topic]
                    numbers[topic] = self._writer.add_topic(declared.name, declared.type, declared.profiles or None)
                write(numbers[topic], received, data)
                self._written += len(data)
            time.sleep(0)

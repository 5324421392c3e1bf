"""The live page open in Chromium for ten minutes at 1 kHz: what it costs the loop, its node and the browser.

    python -m benchmarks.realtime.page_soak [--seconds 600] [--without 120] [--composed] [--fifo] [--aside | --reader]

`./shake lab` in real time plays a sine without end, first without the page, then with the page, Chromium and a client
that opens the page's line and reads nothing. Missed periods of the nodes that keep the time stand beside each other and
beside those of a bare timer, scheduled as they are; Chromium draws without a graphics card, on the same processors.

* Heap: what JavaScript holds after a collection, at the end beyond what it held after a first minute.
* Frames: that came, and that were drawn, a second. Processor: time of the page's node over the stretch.
* `--fifo`: the loop's nodes with SCHED_FIFO (`lab --realtime`).
* `--reader`: a program that reads the page's line takes the browser's place: what the page's own node costs.
* `--lockstep`: as fast as it goes instead, steps a second with the page and without.
* `--aside`: Chromium takes only what nobody else wants (nice 19), nearly as one on another machine.
"""

from __future__ import annotations

import argparse
import contextlib
import http.cookiejar
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks import ROOT
from benchmarks.page.browser import chromium
from benchmarks.realtime.graphs import PRIORITY
from benchmarks.realtime.listener import Listener
from benchmarks.realtime.timing import processor_time, resident
from shake_ros.ros.interface import DIAGNOSTICS

SAVED = Path(__file__).with_suffix(".txt")
READ = SAVED.with_name("page_soak_reader.txt")
TIMER = Path(__file__).with_name("bare_timer.py")
SHAKE: Sequence[str] = (sys.executable, "-m", "shake_ros")
SETTLING = 60.0  # at most, before anything counts [s]
ENDING = 180.0  # of an orderly stop, which is slow where lock-step is [s]
STARTING = 180.0  # timeout until the table runs [s]
NICEST = 19
LOOP = ("plant", "reference_generator")  # keep the time; all others follow
OPENING = (
    "GET /live HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: c29hayBzb2FrIHNvYWsgcw==\r\nOrigin: http://{host}\r\nCookie: {cookie}\r\n\r\n"
)
READER = """
import sys, time
from websockets.sync.client import connect

address, cookie, settling, seconds = *sys.argv[1:3], *map(float, sys.argv[3:])
with connect(f"ws://{address}/live", additional_headers={"Cookie": cookie}, origin=f"http://{address}",
             compression=None, max_size=None) as line:
    begun, frames = time.monotonic() + settling, 0
    while time.monotonic() < begun + seconds:
        frames += isinstance(line.recv(), bytes) and time.monotonic() > begun
print(frames / seconds)
"""


@dataclass
class Stretch:
    """What was counted over a stretch of time."""

    name: str
    seconds: float
    missed: dict[str, int]
    steps: int
    timer: dict[str, float]
    load: float
    told: dict[str, float]


class Lab:
    """A running laboratory and what it prints; `program` in front of `lab`, run in the folder `where`."""

    def __init__(self, arguments: list[str], domain: int, program: Sequence[str] = SHAKE, where: Path = ROOT) -> None:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        self.process = subprocess.Popen(
            [*program, "lab", *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL, text=True, cwd=where, env=environment,
        )  # fmt: skip
        self.lines: list[str] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(line.strip() for line in self.process.stdout)

    def waits_for(self, text: str, timeout: float = STARTING) -> str:
        """The first line with `text`."""
        deadline = time.monotonic() + timeout
        while not (found := [line for line in self.lines if text in line]):
            if time.monotonic() > deadline or self.process.poll() is not None:
                raise RuntimeError(f"lab did not say '{text}': {self.lines}")
            time.sleep(0.1)
        return found[0]

    def node(self, name: str) -> int:
        """Process of one of its nodes."""
        for folder in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                words = (folder / "cmdline").read_bytes().decode().split("\0")
                parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
                if parent == self.process.pid and name in words:
                    return int(folder.name)
        raise RuntimeError(f"lab has no node {name}")

    def end(self) -> None:
        """In order."""
        self.process.send_signal(signal.SIGINT)
        if self.process.wait(ENDING):
            raise RuntimeError(f"lab ended with {self.process.returncode}: {self.lines[-5:]}")


@contextlib.contextmanager
def laboratory(arguments: list[str], domain: int, program: Sequence[str] = SHAKE, where: Path = ROOT) -> Iterator[Lab]:
    """A lab that ends with the block."""
    lab = Lab(arguments, domain, program, where)
    try:
        yield lab
        lab.end()
    finally:
        if lab.process.poll() is None:
            lab.process.kill()


def missed(listener: Listener) -> dict[str, int]:
    """Node → missed periods so far, as it reports them."""
    return {node: int(listener.status(node)["missed_deadlines"]) for node in LOOP}


def steps(listener: Listener) -> int:
    """Steps of the table so far; it reports once a second of its own time."""
    return int(listener.status("plant")["cycles"])


def heap(driver: Any) -> float:
    """What JavaScript holds after a collection [MB]."""
    driver.execute_cdp_cmd("HeapProfiler.collectGarbage", {})
    metrics = driver.execute_cdp_cmd("Performance.getMetrics", {})["metrics"]
    return float(next(one["value"] for one in metrics if one["name"] == "JSHeapUsedSize")) / 1e6


class Memory(threading.Thread):
    """Resident memory of a process all the time [MiB], until `stop`."""

    def __init__(self, process: int) -> None:
        super().__init__(daemon=True)
        self._process, self._stopped = process, threading.Event()
        self.found = [resident(process)]
        self.start()

    def run(self) -> None:
        while not self._stopped.wait(1.0):
            self.found.append(resident(self._process))

    def stop(self) -> list[float]:
        """Growth over the first and over the second half."""
        self._stopped.set()
        half = self.found[len(self.found) // 2]
        return [half - self.found[0], self.found[-1] - half]


def reads_nothing(address: str, cookie: str) -> socket.socket:
    """An operator's page that opens its line and never reads."""
    host = address.split("/")[2]
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    client.connect((host.split(":")[0], int(host.split(":")[1])))
    client.sendall(OPENING.format(host=host, cookie=cookie).encode())
    if not client.recv(12).startswith(b"HTTP/1.1 101"):
        raise RuntimeError("the page did not let the client in")
    return client


@contextlib.contextmanager
def timer(priority: int) -> Iterator[dict[str, float]]:
    """A bare timer beside the block, scheduled as the loop is; its figures are there after it."""
    told: dict[str, float] = {}
    command = [sys.executable, "-I", "-S", str(TIMER), "--priority", str(priority)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    try:
        yield told
    finally:
        told |= json.loads(process.communicate(timeout=30.0)[0])


def count(name: str, seconds: float, listener: Listener, arguments: Sequence[str]) -> Stretch:
    """Count for so long without looking at anything, beside a bare timer."""
    with timer(PRIORITY if "--realtime" in arguments else 0) as ticked:
        before, done = missed(listener), steps(listener)
        begun = time.monotonic()
        time.sleep(seconds)
        time.sleep(1.2)  # reports come once a second
        after, done = missed(listener), steps(listener) - done
    lost = {node: after[node] - before[node] for node in LOOP}
    return Stretch(name, time.monotonic() - begun, lost, done, ticked, os.getloadavg()[0], {})


def without(seconds: float, arguments: list[str], listener: Listener, domain: int) -> Stretch:
    """The loop alone."""
    with laboratory(["--headless", *arguments], domain) as lab:
        lab.waits_for("running:")
        time.sleep(min(SETTLING, seconds / 4))
        return count("without the page", seconds, listener, arguments)


def with_page(
    seconds: float, arguments: list[str], listener: Listener, domain: int, folder: Path, nice: int
) -> Stretch:
    """The loop with the page, a browser and a client that reads nothing."""
    with laboratory(["--port", "0", *arguments], domain) as lab, chromium(folder / "profile", nice=nice) as driver:
        address = lab.waits_for("open http").partition("open ")[2]
        lab.waits_for("running:")
        driver.execute_cdp_cmd("Performance.enable", {})
        driver.get(address)
        cookie = driver.get_cookies()[0]
        client = reads_nothing(address, f"{cookie['name']}={cookie['value']}")
        time.sleep(min(SETTLING, seconds / 4))
        page = lab.node("page")
        held, used, memory = heap(driver), processor_time(page), Memory(page)
        frames, draws = driver.execute_script("return [shake.stats.frames, shake.stats.draws]")
        begun = time.monotonic()
        found = count("with the page", seconds, listener, arguments)
        lasted = time.monotonic() - begun
        then = driver.execute_script("return [shake.stats.frames, shake.stats.draws]")
        found.told = {
            "processor": (processor_time(page) - used) / lasted,
            "frames": (then[0] - frames) / lasted,
            "draws": (then[1] - draws) / lasted,
            "heap": heap(driver) - held,
            "held": held,
            **dict(zip(("first half", "second half"), memory.stop(), strict=True)),
        }
        client.close()
        return found


def with_reader(seconds: float, arguments: list[str], listener: Listener, domain: int) -> Stretch:
    """The loop with the page and a program that reads it."""
    with laboratory(["--port", "0", *arguments], domain) as lab:
        address = lab.waits_for("open http").partition("open ")[2]
        lab.waits_for("running:")
        jar = http.cookiejar.CookieJar()
        urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar)).open(address).close()
        cookie = next(iter(jar))
        settling = min(SETTLING, seconds / 4)
        command = [sys.executable, "-c", READER, address.split("/")[2], f"{cookie.name}={cookie.value}"]
        with subprocess.Popen([*command, str(settling), str(seconds)], stdout=subprocess.PIPE, text=True) as reader:
            time.sleep(settling)
            page = lab.node("page")
            used, begun = processor_time(page), time.monotonic()
            found = count("with page and reader", seconds, listener, arguments)
            found.told["processor"] = (processor_time(page) - used) / (time.monotonic() - begun)
            found.told["frames"] = float(reader.communicate(timeout=30.0)[0])
    return found


def row(found: Stretch) -> str:
    """One stretch."""
    nodes = "".join(f"{found.missed[node]:22}" for node in LOOP)
    shares = " ".join(f"{100.0 * found.missed[node] * 1e-3 / found.seconds:.2f} %" for node in LOOP)
    bare = f"{found.timer['missed']:.0f} ({found.timer['max'] / 1000:.1f} ms)"
    rate = found.steps / found.seconds
    return f"{found.name:20}{found.seconds:8.0f}{rate:9.0f}{nodes}   {shares:16}{bare:>20}{found.load:8.1f}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=600.0, help="with the page [s]")
    parser.add_argument("--without", type=float, default=120.0, help="without the page [s]")
    parser.add_argument("--fifo", action="store_true", help="the loop with SCHED_FIFO")
    parser.add_argument("--composed", action="store_true", help="the loop in one process")
    parser.add_argument("--lockstep", action="store_true", help="as fast as it goes instead of in real time")
    parser.add_argument("--reader", action="store_true", help="a program in the browser's place")
    parser.add_argument("--aside", action="store_true", help="Chromium at the lowest priority")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--save", action="store_true", help=f"write {SAVED.name} as well, or {READ.name}")
    given = parser.parse_args()
    arguments = ["--enabled", "--play", "--reference", "sine_20mm_2hz", "--set", "reference_generator.repeat=true"]
    arguments += ["plant.interlock.causes.deadline_overruns.action=indicate"]
    if given.composed:
        arguments += ["--composed"]
    if given.fifo:
        arguments += ["--realtime"]
    if given.lockstep:
        arguments += ["--lockstep", "--pace", "0"]
    with tempfile.TemporaryDirectory(prefix="page_soak-") as name:
        folder = Path(name)
        arguments += ["--folder", str(folder / "lab")]
        with Listener([DIAGNOSTICS.name], lockstep=False, domain_id=given.domain) as listener:
            alone = without(given.without, arguments, listener, given.domain)
        with Listener([DIAGNOSTICS.name], lockstep=False, domain_id=given.domain) as listener:
            if given.reader:
                watched = with_reader(given.seconds, arguments, listener, given.domain)
            else:
                nice = NICEST if given.aside else 0
                watched = with_page(given.seconds, arguments, listener, given.domain, folder, nice)
    told = watched.told
    command = re.sub(r" --save| --domain \d+", "", " ".join(sys.argv[1:]))
    text = (
        f"python -m benchmarks.realtime.page_soak {command}   ({os.cpu_count()} cores)\n\n"
        f"{'':20}{'seconds':>8}{'steps/s':>9}" + "".join(f"{'missed by':>22}" for _ in LOOP) + "\n"
        f"{'':37}"
        + "".join(f"{node:>22}" for node in LOOP)
        + f"   {'share':16}{'bare timer (longest)':>20}{'load':>8}\n"
        f"{row(alone)}\n{row(watched)}\n\n"
        f"processor of the page's node  {100 * told['processor']:.1f} % of a core (wanted: < 25)\n"
        f"frames that came              {told['frames']:.1f} /s (wanted: >= 25)"
    )
    if not given.reader:
        text += (
            f", drawn {told['draws']:.1f} /s\n"
            f"heap of the page              {told['held']:.1f} MB, grown by {told['heap']:.1f} MB (wanted: < 20)\n"
            f"memory of the page's node     grown by {told['first half']:.1f} MiB in the first half, "
            f"{told['second half']:.1f} in the second, beside a client that reads nothing"
        )
    print(text)
    if given.save:
        (READ if given.reader else SAVED).write_text(f"{text}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

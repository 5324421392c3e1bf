"""Command `target_emulator`: a target computer in a process without ROS, for the node `hardware_bridge`."""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

from shake_ros.bridge.emulator import FAULTS, Emulator, EmulatorParameters, Switches, parse_fault
from shake_ros.bridge.ends import TargetLink
from shake_ros.bridge.wire import key_for, vectors, write_key
from shake_ros.core.quantities import ShakeError
from shake_ros.core.safety.machine import PowerUnitParameters
from shake_ros.realtime import ANY, RealtimeParameters, ask_for, hold_collector
from shake_ros.settings import find, load_interlock, load_table, read_yaml

WHERE = "config/emulator/default.yaml"


def parser() -> argparse.ArgumentParser:
    """Arguments of the command."""
    made = argparse.ArgumentParser(prog="target_emulator", description=(__doc__ or "").strip())
    made.add_argument("--address", help="to listen on")
    made.add_argument("--port", type=int, help="UDP port, 0 for a free one")
    made.add_argument("--key", metavar="FILE", help="shared key; without it loopback addresses only")
    made.add_argument("--make-key", type=Path, metavar="FILE", help="write a new key and end")
    made.add_argument("--test-vector", action="store_true", help="print worked datagrams and end")
    made.add_argument("--table", help="configuration in config/table, or a YAML file")
    made.add_argument("--interlock", help="configuration in config/interlock, or a YAML file")
    made.add_argument("--seed", type=int, help="of the sensor noise")
    made.add_argument("--duration", type=float, default=0.0, help="end after this [s]; 0 = never")
    made.add_argument("--priority", type=int, default=0, help="SCHED_FIFO priority, 0 = usual scheduling")
    made.add_argument("--cpu", type=int, default=ANY, help="the only processor to run on, -1 = any")
    made.add_argument(
        "--journal", type=Path, metavar="FILE", help="write the true motion of the table, 44 bytes for each sample"
    )
    made.add_argument("--report", type=Path, metavar="FILE", help="write what happened as JSON at the end")
    made.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="NAME@START+DURATION=VALUE",
        help=f"one of {', '.join(FAULTS)}; standard input takes lines NAME=VALUE and 'NAME off'",
    )
    return made


def settings(given: argparse.Namespace) -> tuple[EmulatorParameters, PowerUnitParameters]:
    """The configuration with what the command line changes."""
    content: dict[str, Any] = dict(read_yaml(find("emulator", "default")))
    unit = PowerUnitParameters.from_mapping(content.pop("power_unit", {}), f"{WHERE}: power_unit")
    changes = {
        "address": given.address,
        "port": given.port,
        "key_file": given.key,
        "table": given.table,
        "interlock": given.interlock,
        "seed": given.seed,
    }
    content |= {name: value for name, value in changes.items() if value is not None}
    return EmulatorParameters.from_mapping(content, WHERE), unit


def listen(switches: Switches) -> None:
    """Faults by lines on standard input, in a thread of its own."""
    for line in sys.stdin:
        if not line.strip():
            continue
        try:
            switches.switch(line)
        except ShakeError as error:
            print(f"target_emulator: {error}", file=sys.stderr, flush=True)


def open_journal(path: Path) -> BinaryIO:
    """A new file whose rows can be read while it grows; raises ShakeError where there is one already."""
    try:
        return path.open("xb", buffering=0)
    except OSError as error:
        raise ShakeError(f"{path}: {error.strerror}") from None


def main(arguments: Sequence[str]) -> int:
    """Run until SIGINT, SIGTERM or the end of the duration; returns the exit code."""
    given = parser().parse_args(list(arguments))
    if given.make_key:
        write_key(given.make_key)
        return 0
    if given.test_vector:
        for name, data in vectors().items():
            print(f"{name}: {data.hex()}")
        return 0
    own, unit = settings(given)
    realtime = RealtimeParameters(True, given.priority, given.cpu, given.priority > 0, True, given.priority > 0)
    switches = Switches([parse_fault(text) for text in given.fault])
    link = TargetLink(own.address, own.port, key_for(own.key_file, own.address))
    journal = open_journal(given.journal) if given.journal else None
    try:
        emulator = Emulator(own, load_table(own.table), unit, load_interlock(own.interlock), link, switches, journal)
        ending = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: ending.set())
        threading.Thread(target=listen, args=(switches,), daemon=True).start()
        hold_collector()
        refused = ask_for(realtime)
        if refused:
            print(f"target_emulator: {refused}; see docs/howto/realtime.md", file=sys.stderr, flush=True)
        print(f"ready {link.address[0]}:{link.address[1]}", flush=True)
        samples = round(given.duration * own.rate)
        emulator.run(lambda: not ending.is_set() and not 0 < samples <= emulator.machine.samples)
    finally:
        link.close()
        if journal is not None:
            journal.close()
    summary = json.dumps(emulator.summary())
    if given.report:
        given.report.write_text(summary + "\n", encoding="utf-8")
    print(summary, flush=True)
    return 0

"""Latency over the hardware bridge: datagram to topic, and target → ROS → target, with the emulated target.

    python -m benchmarks.bridge.latency [--seconds 60.0] [--domain 0] [--priority 80] [--json FILE]

The graph of four processes (bridge, reference, observer, controller) and the emulator as the fifth, with SCHED_FIFO.
The round trip is the emulator's: from sending measurement k to the arrival of the command that answers k. Late is an
answer after the next sample. The last figures are in latency.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.realtime.driver import Driver
from benchmarks.realtime.emulated_target import emulated_target
from benchmarks.realtime.listener import Listener
from shake_ros.ros.graph import Graph, NodeSpec

NODE = "hardware_bridge"
STARTING = 60.0  # timeout until the table runs [s]
REQUIRED = {"datagram to topic, median": "150 us", "round trip, p99": "1000 us", "late or lost": "0.5 %"}


def nodes(bridge: str, priority: int) -> list[NodeSpec]:
    """The graph that is measured."""
    common = {"realtime.enabled": priority > 0, "realtime.priority": max(priority, 1)}
    return [
        NodeSpec(NODE, {**common, "bridge": bridge}),
        NodeSpec("reference_generator", {**common, "reference": "sine_20mm_2hz"}),
        NodeSpec("observer", common),
        NodeSpec("controller", common),
    ]


def statuses(listener: Listener) -> list[dict[str, str]]:
    """The bridge's values of each second at the stage run."""
    found = []
    for message in listener.messages("/diagnostics"):
        for status in message.status:
            values = {item.key: item.value for item in status.values}
            if status.name.endswith(f": {NODE}") and values.get("stage") == "run":
                found.append(values)
    return found[1:]


def measure(seconds: float, domain: int, priority: int) -> dict[str, object]:
    """One run."""
    with (
        tempfile.TemporaryDirectory() as folder,
        emulated_target(Path(folder), "--priority", str(priority)) as (emulator, bridge),
    ):
        with (
            Listener(["/diagnostics"], lockstep=False, domain_id=domain) as listener,
            Driver(domain_id=domain, node=NODE) as driver,
        ):
            driver.node.destroy_publisher(driver.publisher)
            with Graph(nodes(bridge, priority), domain_id=domain, lockstep=False) as graph:
                graph.wait_until_ready()
                driver.service("reset")
                deadline = time.monotonic() + STARTING
                while not driver.service("enable", data=True)[0]:
                    if time.monotonic() > deadline:
                        raise RuntimeError(f"not enabled: {listener.status(NODE)}")
                    time.sleep(0.1)
                listener.wait_for_status(NODE, "running", STARTING)
                time.sleep(seconds)
                graph.check()
                last = listener.status(NODE)
        emulator.terminate()
        assert emulator.stdout is not None
        target = json.loads(emulator.stdout.read())
    medians = [float(one["datagram_to_topic_p50_us"]) for one in statuses(listener) if one["datagram_to_topic_p50_us"]]
    samples = max(target["samples_at_run"], 1)
    missing = samples - target["answers_at_run"] + target["late_answers"]
    return {
        "datagram_to_topic_p50_us": statistics.median(medians) if medians else None,
        "round_trip_us": target["round_trip_us"],
        "late_or_lost_percent": 100.0 * max(missing, 0) / samples,
        "link_lost": int(last["link.lost"]),
        "samples": samples,
        "overruns_of_the_emulator": target["overruns"],
        "trips": last["trips"],
        "state": last["message"],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=60.0, help="at the stage run [s]")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--priority", type=int, default=80, help="SCHED_FIFO priority, 0 for usual scheduling")
    parser.add_argument("--json", type=Path, help="write the figures here as well")
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    found = measure(given.seconds, given.domain, given.priority)
    for name, value in found.items():
        print(f"{name:28} {value}")
    print("required: " + "; ".join(f"{name} <= {limit}" for name, limit in REQUIRED.items()))
    print(f"load {os.getloadavg()[0]:.1f}")
    if given.json:
        given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())

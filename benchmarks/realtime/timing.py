"""The closed loop in real time at 1 kHz: rate, jitter, latency, late and lost samples, processor and memory.

    python -m benchmarks.realtime.timing [--seconds 60.0] [--graph NAME …] [--domain 0] [--save] [--json FILE]

Four graphs, each with SCHED_FIFO: reference_generator, observer and controller with `plant`, or with `hardware_bridge`
and `target_emulator`; as processes of their own, or composed in one. Beside them, for at most 60 s, the usual rclpy way
(usual_pattern.py) and ours without SCHED_FIFO.

* Period jitter: how far the distance of two samples on the topic is from 1 ms.
* Latency: from the sampling instant to the arrival of the command for it, at the plant, or at the target itself.
* Late: samples whose command came after the next one. Lost: gaps in the stamps at the end of the chain, beyond the
  missed periods.
* Memory: what is resident at the end beyond what is after a warm-up of a fifth of the run, at most 60 s.

The last figures are in timing.txt.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import statistics
import sys
import time
from contextlib import AbstractContextManager, ExitStack, nullcontext
from pathlib import Path
from typing import Any

from tqdm import tqdm

from benchmarks.realtime.driver import Driver
from benchmarks.realtime.graphs import CASES, Case, Composed, Emulator, Reports, emulator, nodes
from benchmarks.realtime.listener import Listener
from shake_ros.ros.graph import Graph
from shake_ros.ros.interface import DIAGNOSTICS

CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
SETTLING = 5.0  # at the start, which the nodes leave out of their figures too [s]
STARTING = 120.0  # timeout until the table runs [s]
OWN_PRIORITY = 5
SHORT = 60.0  # longest run of what is only there to compare with [s]
COMPARED = ("usual", "unscheduled", "bridge_unscheduled")
SAVED = Path(__file__).with_suffix(".txt")
PERCENTILES = ("p50", "p99", "p999", "max")


def resident(process: int) -> float:
    """Resident memory of a process [MiB]."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:")) / 1024.0


def processor_time(process: int) -> float:
    """User and system time of a process [s]."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / CLOCK_TICKS


def start(case: Case, reports: Reports, driver: Driver | None) -> None:
    """At the bridge: enable what does not run, after a reset; the plant of the simulation starts by itself."""
    message = reports.message.get(case.table, "")
    if driver and "controller" in reports.message and not message.startswith(("running", "starting")):
        driver.service("reset")
        driver.service("enable", data=True)


def begin(case: Case, running: Graph | Composed, reports: Reports, driver: Driver | None) -> None:
    """Return when the table moves."""
    deadline = time.monotonic() + STARTING
    while not reports.message.get(case.table, "").startswith("running"):
        running.check()
        if time.monotonic() > deadline:
            raise RuntimeError(f"does not run: {reports.message.get(case.table)}")
        start(case, reports, driver)
        time.sleep(0.5)
        reports.look()


def distribution(text: str, node: str, what: str) -> dict[str, float]:
    """Percentiles that a node has said of its whole run [µs]."""
    found = re.search(rf"\[shake\.{node}\]: whole run: {what} of \d+: (.*) us", text)
    words = found[1].split() if found else []
    return dict(zip(words[::2], map(float, words[1::2]), strict=True))


def measure(
    name: str, seconds: float, domain: int, beside: AbstractContextManager[Any] | None = None
) -> dict[str, Any]:
    """One run; `beside` is there while it is watched."""
    case = CASES[name]
    with (
        emulator(case) as target,
        Listener([DIAGNOSTICS.name], lockstep=False, domain_id=domain) as listener,
        ExitStack() as stack,
    ):
        bridge = target.bridge if target else ""
        running: Graph | Composed
        if case.composed:
            running = stack.enter_context(Composed(name, bridge, domain))
        else:
            graph = Graph(nodes(case, bridge), domain_id=domain, lockstep=False)
            if case.usual:
                graph.program = (sys.executable, "-m", "benchmarks.realtime.usual_pattern")
            running = stack.enter_context(graph)
        reports = Reports(listener)
        driver = stack.enter_context(Driver(domain_id=domain, node=case.table)) if case.bridge else None
        if driver:
            driver.node.destroy_publisher(driver.publisher)
        begin(case, running, reports, driver)
        time.sleep(SETTLING)
        reports.look()
        reports.forget()
        processes = {one: process.pid for one, process in running.processes.items()}
        if target:
            processes["target_emulator"] = target.process.pid
        with beside or nullcontext():
            found = watch(name, seconds, running, processes, reports, driver)
        running.stop()
        text = "".join(running.output(one) for one in running.processes)
        return found | figures(case, reports, text, target)


def watch(
    name: str,
    seconds: float,
    running: Graph | Composed,
    processes: dict[str, int],
    reports: Reports,
    driver: Driver | None,
) -> dict[str, Any]:
    """Processor, memory and load over the run; what has tripped is started again."""
    spent = {one: processor_time(process) for one, process in processes.items()}
    memory: dict[str, list[float]] = {one: [] for one in processes}
    load, held = [], 0
    started = time.monotonic()
    with tqdm(total=round(seconds), desc=name, unit="s", disable=not sys.stderr.isatty()) as bar:
        while (elapsed := time.monotonic() - started) < seconds:
            time.sleep(min(1.0, seconds - elapsed))
            running.check()
            for one, process in processes.items():
                memory[one].append(resident(process))
            load.append(os.getloadavg()[0])
            reports.look()
            table = CASES[name].table
            held += not reports.message[table].startswith("running")
            start(CASES[name], reports, driver)
            bar.update(round(time.monotonic() - started) - bar.n)
    elapsed = time.monotonic() - started
    warm = round(min(60.0, 0.2 * seconds))
    width = max(1, min(10, (len(memory[next(iter(memory))]) - warm) // 3))
    return {
        "seconds": elapsed,
        "load": statistics.mean(load),
        "seconds_not_running": held,
        "cpu": {one: 100.0 * (processor_time(pid) - spent[one]) / elapsed for one, pid in processes.items()},
        "growth": {
            one: statistics.median(row[-width:]) - statistics.median(row[warm : warm + width])
            for one, row in memory.items()
        },
        "memory": {one: row[-1] for one, row in memory.items()},
        "memory_each_minute": {one: [round(value, 2) for value in row[::60]] for one, row in memory.items()},
    }


def figures(case: Case, reports: Reports, text: str, target: Emulator | None) -> dict[str, Any]:
    """Rate, losses and distributions of a run that has ended."""
    table = case.table
    reports.look()
    missed = reports.change(table, "missed_deadlines")
    inputs = {"observer": "joint_states", "controller": "estimate", table: "valve_command"}
    gaps = {node: reports.change(node, f"{topic}.lost") for node, topic in inputs.items()}
    found = {
        "rate": reports.change(table, "cycles") / reports.change(table, "stamp"),
        "missed": missed,
        "lost": max(0.0, max(gaps.values()) - missed),
        "jitter": distribution(text, table, "period jitter"),
        "latency": distribution(text, table, "latency"),
        "trips": reports.of[table][-1]["trips"],
    }
    if target is None:
        return {**found, "late": reports.change(table, "late_commands"), "samples": reports.change(table, "cycles")}
    target.stop()
    said = target.summary
    delays = [one["datagram_to_topic_p50_us"] for one in reports.of[table] if one["datagram_to_topic_p50_us"]]
    return {
        **found,
        "late": said["late_answers"] + max(0, said["samples_at_run"] - said["answers_at_run"]),
        "samples": said["samples_at_run"],
        "latency": said["round_trip_us"],
        "datagram_to_topic": statistics.median(map(float, delays)),
        "link_lost": reports.change(table, "link.lost"),
        "target_overruns": said["overruns"],
        "target_trips": [one["cause"] for one in said["trips"]],
    }


def lines(name: str, row: dict[str, Any]) -> list[str]:
    """What is printed of a run."""
    numbers = [row[kind].get(key, float("nan")) for kind in ("jitter", "latency") for key in PERCENTILES]
    said = [
        f"{name:16}{row['rate']:8.1f}{row['missed']:8.0f}{row['late']:7.0f}{row['lost']:6.0f}"
        + "".join(f"{value:8.0f}" for value in numbers)
    ]
    processor = ", ".join(f"{node} {value:.0f}" for node, value in row["cpu"].items())
    memory = ", ".join(f"{node} {row['growth'][node]:+.2f} of {row['memory'][node]:.0f}" for node in row["growth"])
    said.append(f"  {row['seconds']:.0f} s, {row['samples']:.0f} samples; load {row['load']:.1f}; CPU %: {processor}")
    said.append(f"  memory, MiB: {memory}")
    if "datagram_to_topic" in row:
        share = 100.0 * row["late"] / max(row["samples"], 1)
        said.append(
            f"  datagram to topic {row['datagram_to_topic']:.0f} us; late or lost {share:.3f} %; datagrams lost "
            f"{row['link_lost']:.0f}; periods that the target missed {row['target_overruns']}"
        )
    if row["seconds_not_running"] or row["trips"]:
        said.append(f"  not running in {row['seconds_not_running']} reports; trips: {row['trips']}")
    return said


def report(seconds: float, found: dict[str, dict[str, Any]]) -> str:
    """Everything so far, as it is printed and saved."""
    said = [
        f"python -m benchmarks.realtime.timing --seconds {seconds:g}   ({os.cpu_count()} cores, other work: see load)",
        "",
        f"{'':45}period jitter [us]{'':14}latency [us]",
        f"{'':16}{'Hz':>8}{'missed':>8}{'late':>7}{'lost':>6}" + f"{'p50':>8}{'p99':>8}{'p99.9':>8}{'max':>8}" * 2,
    ]
    for name, row in found.items():
        said += lines(name, row)
    if {"usual", "plant"} <= set(found):
        share = {name: max(found[name]["missed"], 1.0) / found[name]["samples"] for name in ("usual", "plant")}
        said.append(
            f"usual rclpy way : ours with SCHED_FIFO, share of missed periods {share['usual'] / share['plant']:.0f} : 1"
        )
    soaked = {name: max(row["growth"].values()) for name, row in found.items() if name not in COMPARED}
    if soaked:
        worst = max(soaked, key=lambda one: soaked[one])
        said.append(f"largest growth of memory {soaked[worst]:+.2f} MiB ({worst}); required: at most 1 MiB in 600 s")
    return "\n".join(said) + "\n"


def above_other_work() -> None:
    """Look on from above the usual scheduling, below what is measured; what is started does not inherit it."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(OWN_PRIORITY))
    except PermissionError:
        print("without SCHED_FIFO: the figures are those of the usual scheduling", file=sys.stderr)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seconds", type=float, default=60.0, help="of each run [s]")
    parser.add_argument("--graph", action="append", choices=CASES, help="only this one; may be repeated")
    parser.add_argument("--domain", type=int, default=int(os.environ.get("ROS_DOMAIN_ID", "0")))
    parser.add_argument("--save", action="store_true", help=f"write {SAVED.name} as well, after each run")
    parser.add_argument("--json", type=Path, help="add the figures to this file as well")
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    above_other_work()
    earlier = given.json is not None and given.json.is_file()
    found: dict[str, dict[str, Any]] = json.loads(given.json.read_text(encoding="utf-8")) if earlier else {}
    for name in given.graph or CASES:
        seconds = min(given.seconds, SHORT) if name in COMPARED else given.seconds
        found[name] = measure(name, seconds, given.domain)
        text = report(given.seconds, found)
        if given.save:
            SAVED.write_text(text, encoding="utf-8")
        if given.json:
            given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    print(text, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())

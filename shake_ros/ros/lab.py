"""`lab`: the laboratory with one command: table, reference, observer, controller, THD, recorder and page as processes.

It prints one address, says when a node dies and why, starts it again on request (its name and Enter, or on the page),
and ends in order: the table comes to a hold, the pressure goes off, the recording is closed, no process is left.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import tempfile
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path

from shake_ros.page.desk import Exchange
from shake_ros.quantities import ShakeError
from shake_ros.ros.exclusive_writer import ExclusiveWriter
from shake_ros.ros.graph import Graph, NodeSpec, Value, awaited, command
from shake_ros.ros.graph_client import LiveGraph
from shake_ros.ros.interface import ESTIMATE, JOINT_STATES, NAMESPACE, REFERENCE, VALVE_COMMAND
from shake_ros.ros.loop import TAKEN_DOWN, ends_within, ros_context
from shake_ros.ros.supervisor import Supervisor, begin

LOOP = "loop"  # the process of a composed graph
ENOUGH = 4  # processors for five nodes with priority and a page beside
LOOP_TOPICS = (JOINT_STATES, REFERENCE, ESTIMATE, VALVE_COMMAND)
NO_REFERENCE_READER = ("tracking_error", "stale_reference")  # causes that lock-step does not know


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(prog="lab", description=(__doc__ or "").replace("\n", " "))
    table = made.add_mutually_exclusive_group()
    table.add_argument("--table", default="bergamo", metavar="NAME", help="simulated table: of config/table, or a file")
    table.add_argument("--bridge", metavar="NAME", help="a real table instead: of config/bridge, or a file")
    made.add_argument("--reference", default="earthquake", metavar="NAME", help="of config/reference, or a file")
    made.add_argument("--observer", default="linear_bergamo", metavar="NAME", help="of config/observer, or a file")
    made.add_argument("--controller", default="super_twisting_tuned", metavar="NAME", help="of config/controller")
    made.add_argument("--interlock", default="bergamo", metavar="NAME", help="of config/interlock, or a file")
    made.add_argument("--lockstep", action="store_true", help="by stamps instead of by the wall clock")
    pace = "in lock-step at most X times real time; 0: as fast as possible (default: 1 with the page, 0 without)"
    made.add_argument("--pace", type=float, metavar="X", help=pace)
    made.add_argument(
        "--composed", action="store_true", help="plant, observer, controller and reference in one process"
    )
    made.add_argument("--realtime", action="store_true", help="ask the system for real-time scheduling")
    made.add_argument("--record", metavar="NAME", help="record from the start, into FOLDER/recordings/NAME")
    made.add_argument("--enabled", action="store_true", help="begin the start sequence once all nodes run")
    play = "play the reference: with --enabled as soon as commands act, otherwise and in lock-step from the start"
    made.add_argument("--play", action="store_true", help=play)
    made.add_argument("--duration", type=float, default=0.0, metavar="S", help="end after this; 0: on Ctrl-C")
    made.add_argument("--folder", type=Path, default=Path("out/lab"), help="of recordings and results")
    made.add_argument("--set", nargs="+", action="extend", default=[], metavar="NODE.PARAMETER=VALUE", dest="changes")
    made.add_argument("--headless", action="store_true", help="without the page")
    page = made.add_argument_group("page")
    page.add_argument(
        "--model", metavar="NAME", help="declared table, for predictions and fits (default: that of --table)"
    )
    page.add_argument("--port", type=int, default=8421, help="0: any that is free (default: 8421)")
    page.add_argument("--address", default="127.0.0.1", help="to listen on; others than 127.0.0.1 need TLS")
    page.add_argument("--certificate", default="", metavar="FILE", help="of TLS, PEM")
    page.add_argument("--key", default="", metavar="FILE", help="of the certificate, PEM")
    page.add_argument("--host", default="", help="name of this machine in the page's address, with TLS")
    page.add_argument(
        "--operator-required", action="store_true", help="hold the table when the operator's page is gone for 1 s"
    )
    return made


def value_of(text: str) -> Value:
    """The value of a parameter as it is written on a command line.

    >>> value_of("true"), value_of("3"), value_of("1e-3"), value_of("sine")
    (True, 3, 0.001, 'sine')
    """
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def changes(given: Sequence[str]) -> dict[str, dict[str, Value]]:
    """Node → parameters, of `--set`."""
    found: dict[str, dict[str, Value]] = {}
    for text in given:
        name, _, value = text.partition("=")
        node, _, parameter = name.partition(".")
        if not (node and parameter and value):
            raise ShakeError(f"--set {text}: expected NODE.PARAMETER=VALUE")
        found.setdefault(node, {})[parameter] = value_of(value)
    return found


def begins_later(given: argparse.Namespace) -> bool:
    """Whether pressure and reference wait until all nodes run (`begin`); in lock-step time waits itself."""
    return bool(given.enabled and not given.lockstep)


def table_node(given: argparse.Namespace) -> NodeSpec:
    """The simulated table, or the bridge to a real one."""
    own: dict[str, Value] = {
        "enabled": given.enabled and not begins_later(given),
        "interlock.configuration": given.interlock,
    }
    if given.operator_required:
        own["interlock.causes.operator_gone.action"] = "program_hold"
    if given.bridge:
        return NodeSpec("hardware_bridge", {**own, "bridge": given.bridge})
    if given.lockstep:
        own["pace"] = (0.0 if given.headless else 1.0) if given.pace is None else given.pace
        own |= {f"interlock.causes.{cause}.action": "none" for cause in NO_REFERENCE_READER}
    return NodeSpec("plant", {**own, "table": given.table, "duration": given.duration})


def loop_nodes(given: argparse.Namespace) -> list[NodeSpec]:
    """What runs the table, in the order of their start."""
    return [
        table_node(given),
        NodeSpec("reference_generator", {"reference": given.reference, "play": given.play and not begins_later(given)}),
        NodeSpec("observer", {"observer": given.observer}),
        NodeSpec("controller", {"controller": given.controller}),
    ]


def page_node(given: argparse.Namespace, socket: Path) -> NodeSpec:
    """The live page."""
    names = ("port", "address", "certificate", "key", "host", "operator_required")
    own: dict[str, Value] = {name: getattr(given, name) for name in names}
    declared = given.model or ("" if given.bridge else given.table)
    model: dict[str, Value] = {"model": declared} if declared else {}
    return NodeSpec("page", {**own, **model, "folder": str(given.folder.absolute()), "lab": str(socket)})


def nodes(given: argparse.Namespace, socket: Path) -> list[NodeSpec]:
    """All processes: page, recorder and analyzer first, that they miss nothing."""
    wanted = changes(given.changes)
    common: dict[str, Value] = {"realtime.enabled": True} if given.realtime else {}
    loop = [NodeSpec(one.executable, {**one.parameters, **common}) for one in loop_nodes(given)]
    others = []
    if not given.headless:
        others.append(page_node(given, socket))
    if given.record:
        others.append(NodeSpec("recorder", {"output": str(given.folder.absolute() / "recordings" / given.record)}))
    apart = given.composed and not given.lockstep  # its fit takes tens of periods at a time
    (others if apart else loop).append(NodeSpec("thd_analyzer"))
    for name in wanted:
        if name not in (known := [one.executable for one in (*loop, *others)]):
            raise ShakeError(f"--set {name}…: no such node here; there are {', '.join(known)}")
    loop, others = (
        [NodeSpec(one.executable, {**one.parameters, **wanted.get(one.executable, {})}) for one in group]
        for group in (loop, others)
    )
    if not given.composed:
        return [*others, *loop]
    awaiting = {"wait_for": awaited([*loop, *others], given.lockstep)}
    loop[0] = NodeSpec(loop[0].executable, {**awaiting, **loop[0].parameters})
    return [*others, NodeSpec(loop[0].executable, name=LOOP, program=command(loop, given.lockstep))]


def prepare(given: argparse.Namespace) -> None:
    """Refuse what cannot work before anything starts."""
    recording = given.folder / "recordings" / (given.record or "")
    if given.record and recording.exists():
        raise ShakeError(f"{recording}: exists already; name another recording with --record")
    if given.pace is not None and not given.lockstep:
        raise ShakeError("--pace: only with --lockstep")
    if given.bridge and given.lockstep:
        raise ShakeError("--bridge: a real table runs in real time; omit --lockstep")
    if given.operator_required and given.headless:
        raise ShakeError("--operator-required: needs the page; omit --headless")
    if given.bridge and given.duration:
        raise ShakeError("--duration: only the simulated table ends by itself")
    if not given.headless and given.address != "127.0.0.1" and not (given.certificate and given.key):
        raise ShakeError(f"--address {given.address}: beyond 127.0.0.1 only with --certificate and --key (TLS)")
    nodes(given, Path("lab"))
    (given.folder / "recordings").mkdir(parents=True, exist_ok=True)


def crowded(given: argparse.Namespace, count: int) -> str:
    """What to say where nodes with priority leave the page no processor; empty where they do."""
    if not given.realtime or given.composed or given.headless or count >= ENOUGH:
        return ""
    return (
        f"--realtime on {count} processors: five processes with priority starve page, browser and whatever "
        "else runs here; --composed runs plant, observer and controller in one"
    )


def refuse_a_second_graph(live: LiveGraph, domain: int) -> None:
    """Raise ShakeError where a running node of this machine has a topic of the loop."""
    exclusive = ExclusiveWriter(domain)
    try:
        for topic in LOOP_TOPICS:
            exclusive.take("topic", str(live.node.resolve_topic_name(topic.name)))
    finally:
        exclusive.give_up()


def main(arguments: Sequence[str]) -> int:
    """Run the laboratory; returns the exit code."""
    given = parser().parse_args(list(arguments))
    prepare(given)
    if warning := crowded(given, len(os.sched_getaffinity(0))):
        print(f"lab: warning: {warning}", file=sys.stderr, flush=True)
    domain = int(os.environ.get("ROS_DOMAIN_ID", "0"))
    with ros_context([], domain_id=domain) as context:
        live = LiveGraph(context, NAMESPACE)
        code = 1
        try:
            code = _supervised(given, live, domain)
        finally:
            with ends_within(TAKEN_DOWN, code):  # the middleware may not return while the nodes leave, see loop.py
                live.close()
    return code


def _supervised(given: argparse.Namespace, live: LiveGraph, domain: int) -> int:
    """Run the graph's processes to their end; returns the exit code."""
    refuse_a_second_graph(live, domain)
    with tempfile.TemporaryDirectory(prefix="shake_ros-lab-") as folder, closing(Exchange(Path(folder))) as exchange:
        graph = Graph(nodes(given, exchange.path), domain_id=domain, lockstep=given.lockstep)
        later = begins_later(given)
        start = begin(live, later, later and given.play)
        supervisor = Supervisor(graph, live, start, exchange, given.folder.absolute() / "recordings")
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda *_: supervisor.ask_to_stop())
        try:
            return supervisor.run()
        finally:
            graph.kill()

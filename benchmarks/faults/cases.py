"""The faults of the campaign (campaign.py): what is done, and for how long."""

from __future__ import annotations

from dataclasses import dataclass

PLANT, BRIDGE = "plant", "bridge"
WATCH = 0.8  # seconds that the table is watched after a fault, which lasts as long


@dataclass(frozen=True)
class Case:
    """One fault.

    Parameters
    ----------
    name : on the command line and in the table.
    kind : how it is made: machine, message, service, second, kill, stop, restart.
    what : of the machine: the fault; of messages: TOPIC.FAULT; service: its name; else the node.
    value : of the fault.
    links : where it makes sense.
    note : why no limit on the further travel applies; empty where one does.
    """

    name: str
    kind: str
    what: str
    value: bool | float = True
    links: tuple[str, ...] = (PLANT, BRIDGE)
    note: str = ""


STUCK = "the oil flows until the pressure is gone: a stuck spool needs a second valve"
NO_TABLE = "the simulated table ended with it"
NODES = {
    PLANT: ("plant", "reference_generator", "observer", "controller"),
    BRIDGE: ("hardware_bridge", "reference_generator", "observer", "controller", "target_emulator"),
}

MACHINE = [
    Case("supply failure", "machine", "supply_failure"),
    Case("valve stuck where it is", "machine", "valve_stuck", note=STUCK),
    Case("valve stuck open", "machine", "valve_stuck_at", 1.0, note=STUCK),
    Case("position cable off", "machine", "position_off"),
    Case("acceleration cable off", "machine", "acceleration_off"),
    Case("supply pressure cable off", "machine", "pressure_off"),
    Case("position frozen", "machine", "position_frozen"),
    Case("acceleration frozen", "machine", "acceleration_frozen"),
    Case("position jumps 10 mm", "machine", "position_bias", 0.01),
    Case("acceleration off by 20 m/s2", "machine", "acceleration_bias", 20.0),
    Case("position noise 10 mm", "machine", "position_noise", 0.01),
    Case("acceleration noise 50 m/s2", "machine", "acceleration_noise", 50.0),
    Case("target silent", "machine", "silent", links=(BRIDGE,)),
    Case("target deaf", "machine", "deaf", links=(BRIDGE,)),
]
OPERATOR = [
    Case("e-stop service", "service", "stop"),
    Case("second commander", "second", "valve_command"),
]
MESSAGES = [
    Case("command NaN", "message", "valve_command.nan", 1.0),
    Case("command out of range", "message", "valve_command.bias", 3.0),
    Case("command jumps once", "message", "valve_command.jump", -0.9),
    Case("command frozen", "message", "valve_command.freeze"),
    Case("command noise 0.5", "message", "valve_command.noise", 0.5),
    Case("command delayed 50 ms", "message", "valve_command.delay", 0.05),
    Case("command lost", "message", "valve_command.drop", 1.0),
    Case("command lost 1 of 2", "message", "valve_command.drop", 0.5),
    Case("command doubled", "message", "valve_command.duplicate", 0.2),
    Case("command reordered", "message", "valve_command.reorder", 0.2),
    Case("measurement frozen on the topic", "message", "joint_states.freeze"),
    Case("measurement off by 20 mm on the topic", "message", "joint_states.bias", 0.02),
    Case("measurement NaN on the topic", "message", "joint_states.nan", 1.0),
    Case("measurement delayed 30 ms on the topic", "message", "joint_states.delay", 0.03),
    Case("measurement lost on the topic", "message", "joint_states.drop", 1.0),
]
ENDS_THE_TABLE = [(kind, node) for kind in ("SIGKILL", "restart") for node in ("plant", "target_emulator")]
PROCESSES = [
    Case(f"{kind} {node}", kind, node, links=(link,), note=NO_TABLE if (kind, node) in ENDS_THE_TABLE else "")
    for link in (PLANT, BRIDGE)
    for kind in ("SIGSTOP", "SIGKILL", "restart")
    for node in NODES[link]
]


def cases(link: str, only: list[str]) -> list[Case]:
    """The faults of a link; of those named, if any, by a part of their names."""
    found = [case for case in (*MACHINE, *OPERATOR, *PROCESSES, *MESSAGES) if link in case.links]
    return [case for case in found if not only or any(part in case.name for part in only)]

"""The one table of entry points, nodes and offline commands; setup.py reads it without importing the package."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """An entry point: where it is in the package, imported when it is called, and what it does in a line.

    A node's module has `build(frame)`. A command is a function of its arguments that returns the exit code:
    `NAME_command`, with the NAME behind the module, else `main`. A node that can do something without ROS has both.
    """

    place: str
    line: str

    @property
    def module(self) -> str:
        """Dotted name of its module."""
        return f"shake_ros.{self.place.partition(':')[0]}"

    @property
    def function(self) -> str:
        """Name of the command's function."""
        name = self.place.partition(":")[2]
        return f"{name}_command" if name else "main"

    @property
    def is_node(self) -> bool:
        """Whether it is a ROS node (else an offline command)."""
        return self.module.endswith("_node")


ENTRY_POINTS: dict[str, Entry] = {
    "plant": Entry("ros.plant_node", "simulated table: valve, cylinder, specimen, sensors"),
    "hardware_bridge": Entry("ros.hardware_bridge_node", "the same topics over a real table, by datagrams"),
    "reference_generator": Entry("ros.reference_node", "plays sine, multi-sine, sweep, pulse, step, quake"),
    "observer": Entry("ros.observer_node", "estimates velocity and acceleration from the position"),
    "controller": Entry("ros.controller_node", "follows the reference with the valve command"),
    "thd_analyzer": Entry("ros.thd_node", "live harmonics of the acceleration and their distortion"),
    "twin": Entry("ros.twin_node", "follows a found table beside the running one; reports what changed"),
    "recorder": Entry("ros.recorder_node", "records topics into a rosbag2 recording; --recover PATH"),
    "player": Entry("ros.player_node", "plays a recording with its recorded timing"),
    "faults": Entry("ros.faults_node", "between two nodes: delays, drops, repeats, freezes or falsifies samples"),
    "page": Entry("ros.page_node", "the live page: curves, controls, recordings, in a browser"),
    "lab": Entry("ros.lab", "start all nodes and the live page; Ctrl-C stops them in order"),
    "foxglove": Entry("ros.foxglove_node", "a thinned copy of the topics for Foxglove, on this machine"),
    "ros2": Entry("ros.ros2", "topic list, echo, hz; param list, get, set, dump; service list, call"),
    "target_emulator": Entry(
        "bridge.emulator", "emulate a target computer without ROS: the table behind the bridge's datagrams"
    ),
    "demo": Entry(
        "demonstration.demo:demo", "run the main job end to end: recordings, missing effect, better tracking"
    ),
    "identify": Entry("cli.repair:identify", "fit the declared model to recordings"),
    "close_loop": Entry(
        "cli.repair:close_loop", "find what the declared model lacks, add it, compare before and after"
    ),
    "follow": Entry("cli.repair:follow", "follow a found table over recordings: what changed, and when"),
    "table": Entry("cli.repair:table", "write a table's configuration from its nameplates, with the assumptions made"),
    "schedule": Entry(
        "thesis.commands:schedule", "compare a neural network's parameters (thesis 6.3.5) with an effect"
    ),
    "import_csv": Entry("cli.repair:import_csv", "convert a laboratory's table of columns into a recording"),
    "figures": Entry("thesis.commands:figures", "draw figures of the thesis: fluid, friction, valve, effects"),
    "sensitivity": Entry(
        "thesis.commands:sensitivity", "compute the motion's sensitivity to single parameters (figures 6.19–6.24)"
    ),
    "reproduce": Entry("thesis.commands:reproduce", "run chapter 6 of the thesis again, claim by claim"),
    "frequency_response": Entry(
        "cli.signals:frequency_response", "estimate gain, delay and coherence in a recording, and plot them"
    ),
    "tune": Entry("cli.control:tune", "tune a controller over loads and perturbed tables; writes a configuration"),
    "commission": Entry("cli.laboratory:commission", "bring a new table into service: run, fit, make gains, go higher"),
    "compare": Entry("cli.control:compare", "compare the controllers on references, loads and perturbed tables"),
    "campaign": Entry("cli.control:campaign", "run a study of many fits, here or on a cluster; it can be resumed"),
    "thd": Entry("cli.signals:thd", "compute the harmonics of a recording"),
    "spectrum": Entry("cli.signals:spectrum", "compute response spectra of recordings, at several damping ratios"),
    "multisine_split": Entry(
        "cli.signals:multisine_split", "split a multi-sine's response into linear, even and odd parts and noise"
    ),
    "measured_runs": Entry(
        "thesis.commands:measured_runs",
        "compare the real table's harmonics (tables 6.1, 6.2) with printed and fitted models",
    ),
    "iterate": Entry("cli.laboratory:iterate", "compute the next run's drive from the error of the last one"),
    "qualify": Entry(
        "cli.laboratory:qualify", "test a specimen against a required response spectrum, with a certificate"
    ),
    "record_scale": Entry("cli.signals:record_scale", "read, correct and scale an accelerogram into the envelope"),
}
NODES = {name: entry for name, entry in ENTRY_POINTS.items() if entry.is_node}
COMMANDS = {name: entry for name, entry in ENTRY_POINTS.items() if not entry.is_node}

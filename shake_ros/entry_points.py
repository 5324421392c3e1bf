"""The one table of entry points, nodes and offline commands; setup.py reads it without importing the package."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """An entry point: where it is, imported when it is called, and what it does in a line.

    A node's module has `build(frame)`. A command is a function of its arguments that returns the exit code: the one
    named behind the module, else `main`. A node that can do something without ROS has both.
    """

    place: str
    line: str

    @property
    def module(self) -> str:
        """Dotted name of its module."""
        return self.place.partition(":")[0]

    @property
    def function(self) -> str:
        """Name of the command's function."""
        return self.place.partition(":")[2] or "main"

    @property
    def is_node(self) -> bool:
        """Whether it is a ROS node (else an offline command)."""
        return self.module.endswith("_node")


ENTRY_POINTS: dict[str, Entry] = {
    "plant": Entry("shake_ros.ros.plant_node", "simulated table: valve, cylinder, specimen, sensors"),
    "hardware_bridge": Entry("shake_ros.ros.hardware_bridge_node", "the same topics over a real table, by datagrams"),
    "reference_generator": Entry("shake_ros.ros.reference_node", "plays sine, multi-sine, sweep, pulse, step, quake"),
    "observer": Entry("shake_ros.ros.observer_node", "estimates velocity and acceleration from the position"),
    "controller": Entry("shake_ros.ros.controller_node", "follows the reference with the valve command"),
    "thd_analyzer": Entry("shake_ros.ros.thd_node", "live harmonics of the acceleration and their distortion"),
    "twin": Entry("shake_ros.ros.twin_node", "follows a found table beside the running one; reports what changed"),
    "recorder": Entry("shake_ros.ros.recorder_node", "records topics into a rosbag2 recording; --recover PATH"),
    "player": Entry("shake_ros.ros.player_node", "plays a recording with its recorded timing"),
    "faults": Entry(
        "shake_ros.ros.faults_node", "between two nodes: delays, drops, repeats, freezes or falsifies samples"
    ),
    "page": Entry("shake_ros.ros.page_node", "the live page: curves, controls, recordings, in a browser"),
    "lab": Entry("shake_ros.ros.lab", "start all nodes and the live page; Ctrl-C stops them in order"),
    "foxglove": Entry("shake_ros.ros.foxglove_node", "a thinned copy of the topics for Foxglove, on this machine"),
    "ros2": Entry("shake_ros.ros.ros2", "topic list, echo, hz; param list, get, set, dump; service list, call"),
    "target_emulator": Entry(
        "shake_ros.bridge.emulator", "emulate a target computer without ROS: the table behind the bridge's datagrams"
    ),
    "demo": Entry(
        "shake_ros.demonstration.demo:demo_command",
        "run the main job end to end: recordings, missing effect, better tracking",
    ),
    "identify": Entry("shake_ros.cli.repair:identify_command", "fit the declared model to recordings"),
    "close_loop": Entry(
        "shake_ros.cli.repair:close_loop_command",
        "find what the declared model lacks, add it, compare before and after",
    ),
    "follow": Entry(
        "shake_ros.cli.repair:follow_command", "follow a found table over recordings: what changed, and when"
    ),
    "table": Entry(
        "shake_ros.cli.repair:table_command",
        "write a table's configuration from its nameplates, with the assumptions made",
    ),
    "schedule": Entry(
        "shake_ros.thesis.commands:schedule_command",
        "compare a neural network's parameters (thesis 6.3.5) with an effect",
    ),
    "import_csv": Entry(
        "shake_ros.cli.repair:import_csv_command", "convert a laboratory's table of columns into a recording"
    ),
    "figures": Entry(
        "shake_ros.thesis.commands:figures_command",
        "draw figures of the thesis: fluid, friction, valve, effects",
    ),
    "sensitivity": Entry(
        "shake_ros.thesis.commands:sensitivity_command",
        "compute the motion's sensitivity to single parameters (figures 6.19–6.24)",
    ),
    "reproduce": Entry(
        "shake_ros.thesis.commands:reproduce_command", "run chapter 6 of the thesis again, claim by claim"
    ),
    "frequency_response": Entry(
        "shake_ros.cli.signals:frequency_response_command",
        "estimate gain, delay and coherence in a recording, and plot them",
    ),
    "tune": Entry(
        "shake_ros.cli.control:tune_command",
        "tune a controller over loads and perturbed tables; writes a configuration",
    ),
    "commission": Entry(
        "shake_ros.cli.laboratory:commission_command", "bring a new table into service: run, fit, make gains, go higher"
    ),
    "compare": Entry(
        "shake_ros.cli.control:compare_command",
        "compare the controllers on references, loads and perturbed tables",
    ),
    "campaign": Entry(
        "shake_ros.cli.control:campaign_command",
        "run a study of many fits, here or on a cluster; it can be resumed",
    ),
    "thd": Entry("shake_ros.cli.signals:thd_command", "compute the harmonics of a recording"),
    "spectrum": Entry(
        "shake_ros.cli.signals:spectrum_command", "compute response spectra of recordings, at several damping ratios"
    ),
    "multisine_split": Entry(
        "shake_ros.cli.signals:multisine_split_command",
        "split a multi-sine's response into linear, even and odd parts and noise",
    ),
    "measured_runs": Entry(
        "shake_ros.thesis.commands:measured_runs_command",
        "compare the real table's harmonics (tables 6.1, 6.2) with printed and fitted models",
    ),
    "iterate": Entry(
        "shake_ros.cli.laboratory:iterate_command", "compute the next run's drive from the error of the last one"
    ),
    "qualify": Entry(
        "shake_ros.cli.laboratory:qualify_command",
        "test a specimen against a required response spectrum, with a certificate",
    ),
    "record_scale": Entry(
        "shake_ros.cli.signals:record_scale_command", "read, correct and scale an accelerogram into the envelope"
    ),
}
NODES = {name: entry for name, entry in ENTRY_POINTS.items() if entry.is_node}
COMMANDS = {name: entry for name, entry in ENTRY_POINTS.items() if not entry.is_node}

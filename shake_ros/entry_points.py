"""The one table of entry points, nodes and offline commands; setup.py reads it without importing the package."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """An entry point: its module, imported when it is called, and what it does in a line.

    A node's module has `build(frame)`, a command's module `main(arguments) -> exit code`; a node that can do
    something without ROS has both.
    """

    module: str
    line: str

    @property
    def is_node(self) -> bool:
        """Whether it is a ROS node (else an offline command)."""
        return self.module.endswith("_node")


ENTRY_POINTS: dict[str, Entry] = {
    "plant": Entry("shake_ros.ros.plant_node", "simulated table: valve, cylinder, specimen, sensors"),
    "hardware_bridge": Entry("shake_ros.ros.hardware_bridge_node", "the plant's face over a real table, by datagrams"),
    "reference_generator": Entry("shake_ros.ros.reference_node", "plays sine, multi-sine, sweep, pulse, step, quake"),
    "observer": Entry("shake_ros.ros.observer_node", "estimates velocity and acceleration from the position"),
    "controller": Entry("shake_ros.ros.controller_node", "follows the reference with the valve command"),
    "thd_analyzer": Entry("shake_ros.ros.thd_node", "live harmonics of the acceleration and their distortion"),
    "recorder": Entry("shake_ros.ros.recorder_node", "everything named into a rosbag2 recording; --recover PATH"),
    "player": Entry("shake_ros.ros.player_node", "a recording's messages again, with the recorded timing"),
    "faults": Entry(
        "shake_ros.ros.faults_node", "between two nodes: delays, drops, doubles, freezes, falsifies samples"
    ),
    "page": Entry("shake_ros.ros.page_node", "the live page: curves, controls, recordings, in a browser"),
    "lab": Entry("shake_ros.ros.lab", "all nodes and the live page with one command; Ctrl-C ends them in order"),
    "foxglove": Entry("shake_ros.ros.foxglove_node", "a thinned copy of the topics for Foxglove, on this machine"),
    "ros2": Entry("shake_ros.ros.ros2", "topic list, echo, hz; param list, get, set, dump; service list, call"),
    "target_emulator": Entry(
        "shake_ros.cli.target_emulator", "a target computer without ROS: the table behind the bridge's datagrams"
    ),
    "demo": Entry("shake_ros.cli.demo", "the main job end to end: measured data, loop, missing effect, tracking"),
    "identify": Entry("shake_ros.cli.identify", "fit the declared model to recordings"),
    "close_loop": Entry("shake_ros.cli.close_loop", "find what the declared model lacks, add it, before and after"),
    "table": Entry("shake_ros.cli.table", "a table's configuration from nameplates; says what it assumed"),
    "schedule": Entry("shake_ros.cli.schedule", "parameters by a neural network (thesis 6.3.5) beside the effect"),
    "import_csv": Entry("shake_ros.cli.import_csv", "a laboratory's table of columns becomes a recording"),
    "figures": Entry("shake_ros.cli.figures", "figures of the thesis drawn again: fluid, friction, valve, effects"),
    "sensitivity": Entry("shake_ros.cli.sensitivity", "what each parameter does to the motion (thesis 6.3.4)"),
    "reproduce": Entry("shake_ros.cli.reproduce", "chapter 6 of the thesis run again: claim by claim, holds or not"),
    "frequency_response": Entry(
        "shake_ros.cli.frequency_response", "gain, delay and coherence in a recording, plotted"
    ),
    "tune": Entry(
        "shake_ros.cli.tune", "gains of a controller over loads and perturbed tables, as a new configuration"
    ),
    "commission": Entry("shake_ros.cli.commission", "the guided way on a new table: run, learn, gains, go higher"),
    "compare": Entry("shake_ros.cli.compare", "the controllers side by side on references, loads and perturbed tables"),
    "campaign": Entry(
        "shake_ros.cli.campaign", "a study of many fits or loops, here or on a cluster; it can go on later"
    ),
    "thd": Entry("shake_ros.cli.thd", "harmonic table of a recording"),
    "spectrum": Entry("shake_ros.cli.spectrum", "response spectra of recordings, at several dampings"),
    "multisine_split": Entry(
        "shake_ros.cli.multisine_split", "linear, even and odd parts and noise of a multi-sine's response"
    ),
    "measured_runs": Entry(
        "shake_ros.cli.measured_runs", "the real table's harmonics against printed and fitted models"
    ),
    "iterate": Entry("shake_ros.cli.iterate", "the drive of the next run from what the last one missed"),
    "qualify": Entry("shake_ros.cli.qualify", "a required response spectrum becomes a motion, a test, a certificate"),
    "record_scale": Entry("shake_ros.cli.record_scale", "read, correct and scale an accelerogram into the envelope"),
}
NODES = {name: entry for name, entry in ENTRY_POINTS.items() if entry.is_node}
COMMANDS = {name: entry for name, entry in ENTRY_POINTS.items() if not entry.is_node}

"""`python -m shake_ros NAME …`: calls an entry point by its name.

Exit codes: 0 done, 2 wrong arguments or input (one line on standard error), 1 anything else.
"""

from __future__ import annotations

import faulthandler
import gc
import importlib
import os
import signal
import sys
import warnings
from collections.abc import Sequence

from shake_ros.entry_points import COMMANDS, ENTRY_POINTS, NODES
from shake_ros.quantities import ShakeError, unknown_name

ROS_PACKAGES = {
    "rclpy", "builtin_interfaces", "rcl_interfaces", "rosgraph_msgs", "std_msgs", "std_srvs", "sensor_msgs",
    "diagnostic_msgs", "trajectory_msgs",
}  # fmt: skip
RECORDING_PACKAGES = {"rosbags", "mcap", "zstandard", "lz4"}
DISTRIBUTIONS = {"yaml": "pyyaml", "foxglove": "foxglove-sdk"}  # where the name to install is another


def overview() -> str:
    """All names with a line each."""
    lines = ["python -m shake_ros NAME …", "", "nodes (parameters: NAME --help, NAME --ros-args -p name:=value):"]
    lines += [f"  {name:20} {entry.line}" for name, entry in NODES.items()]
    lines += ["", "commands (NAME --help):"]
    lines += [f"  {name:20} {entry.line}" for name, entry in COMMANDS.items()]
    return "\n".join(lines)


def call(name: str, arguments: Sequence[str]) -> int:
    """Run one entry point; returns its exit code."""
    if name not in ENTRY_POINTS:
        raise unknown_name("name", name, ENTRY_POINTS)
    if name in NODES and {"-h", "--help"} & set(arguments):
        from shake_ros.ros import node_help

        print(node_help.text(importlib.import_module(ENTRY_POINTS[name].module).build, name))
        return 0
    if name in NODES:
        gc.disable()  # it takes a tenth of a start; the node's executor decides when it runs again
    try:
        module = importlib.import_module(ENTRY_POINTS[name].module)
    except ModuleNotFoundError as error:
        raise missing(name, error) from None
    if name in NODES and not hasattr(module, "main"):
        from shake_ros.ros import loop

        return loop.main(module.build, name, arguments)
    return int(getattr(module, ENTRY_POINTS[name].function)(list(arguments)))


def missing(name: str, error: ModuleNotFoundError) -> ShakeError | ModuleNotFoundError:
    """What to install where a third-party package is missing; a missing module of this package is a bug."""
    package = (error.name or "").partition(".")[0]
    if package in ("", "shake_ros"):
        return error
    if package in ROS_PACKAGES:
        how = "source a ROS 2 installation that has it, or install the wheels: pip install 'shake_ros[ros]'"
    else:
        how = f"pip install {DISTRIBUTIONS.get(package, package)} (rosdep: python3-rosbags-pip, mcap-ros2-support)"
        how = how if package in RECORDING_PACKAGES else how.partition(" (")[0]
    return ShakeError(f"{name} needs the Python package '{package}', which is not installed: {how}")


def leave_on_terminate() -> None:
    """Let SIGTERM unwind the program as an exit with code 143, so that unfinished results are removed."""

    def leave(*_: object) -> None:
        raise SystemExit(128 + signal.SIGTERM)

    signal.signal(signal.SIGTERM, leave)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what the command line names."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given or given[0] in ("-h", "--help"):
        print(overview())
        return 0
    try:
        if given[0] in COMMANDS:
            leave_on_terminate()
        return call(given[0], given[1:])
    except ShakeError as error:
        print(f"shake_ros {given[0]}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 0 if given[0] in NODES else 130  # a node that is asked to end has done so, even while it starts
    except BrokenPipeError:  # whoever read our output has closed it
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def program() -> int:
    """`main` as a process of its own.

    A node exits at once: everything that it holds is closed by now, and tearing down its compiled code would cost the
    interpreter half a second of processor time, many seconds for a graph of seven nodes on a busy machine. Ctrl-C ends
    it as soon while it starts, until its loop obeys signals: an import may turn a KeyboardInterrupt into another error.
    """
    if not sys.warnoptions:
        warnings.simplefilter("ignore")  # from numpy and others, for developers: -W and the tests show them
    node = bool(sys.argv[1:]) and sys.argv[1] in NODES
    if node:
        signal.signal(signal.SIGINT, lambda *_: os._exit(0))
        faulthandler.enable()  # a crash, or SIGABRT to a node that hangs, prints where each thread is
    code = main()
    if node:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code


if __name__ == "__main__":
    sys.exit(program())

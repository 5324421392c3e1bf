"""The real robot_state_publisher on our description and joint states: does each position come out as a transform?

    /usr/bin/python3 test/scripts/robot_state_publisher.py

Takes the program of Debian's ros-robot-state-publisher (ROS 1's, on urdf and kdl_parser, as ROS 2's is), with
python3-rosmaster, python3-rospy, python3-sensor-msgs and python3-tf2-msgs, and the system's Python, which has them.
Ends with 3, and says so, without them; with 0 where every position comes out along x of `ground` under its own stamp.
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PROGRAM = Path("/usr/lib/robot_state_publisher/robot_state_publisher")
MASTER = "/usr/bin/rosmaster"
DESCRIPTION = Path(__file__).resolve().parents[2] / "config" / "description" / "shaking_table.urdf"
NONE = 3  # exit status without the program
COUNT = 300
TIMEOUT = 20.0  # [s]


@contextlib.contextmanager
def running(*command: str | Path) -> Iterator[None]:
    """A program beside the block."""
    process = subprocess.Popen(command)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def until(what: str, seen: Any) -> None:
    """Wait until `seen()` is true."""
    deadline = time.monotonic() + TIMEOUT
    while not seen():
        assert time.monotonic() < deadline, f"{what} never came"
        time.sleep(0.002)


def transforms() -> tuple[list[Any], list[Any], dict[int, float]]:
    """Transforms of the moving and of the fixed joints, and what was published: stamp [ns] → position [m]."""
    import rospy
    from sensor_msgs.msg import JointState
    from tf2_msgs.msg import TFMessage

    moving: list[Any] = []
    fixed: list[Any] = []
    rospy.init_node("looks_on", disable_signals=True)
    rospy.Subscriber("/tf", TFMessage, lambda message: moving.extend(message.transforms))
    rospy.Subscriber("/tf_static", TFMessage, lambda message: fixed.extend(message.transforms))
    writer = rospy.Publisher("/shake/joint_states", JointState, queue_size=COUNT)
    rospy.set_param("/shake/robot_description", DESCRIPTION.read_text(encoding="utf-8"))
    sent: dict[int, float] = {}
    with running(PROGRAM, "_publish_frequency:=1000", "__ns:=/shake"):
        until("robot_state_publisher", lambda: writer.get_num_connections() and fixed)
        begun = time.time_ns()
        for k in range(COUNT):
            stamp, position = begun + k * 1_000_000, 0.1 * math.sin(0.05 * k)
            message = JointState(name=["table"], position=[position])
            message.header.stamp = rospy.Time(stamp // 10**9, stamp % 10**9)
            sent[stamp] = position
            writer.publish(message)
            # its queue holds one message: each waits for the answer to the one before
            until(f"transform {k}", lambda: moving and moving[-1].header.stamp.to_nsec() == max(sent))
    return moving, fixed, sent


def main() -> int:
    if not (PROGRAM.exists() and Path(MASTER).exists() and importlib.util.find_spec("rospy")):
        print("NOT TESTED: Debian's robot_state_publisher and rospy are not in this Python's reach", file=sys.stderr)
        return NONE
    port = free_port()
    os.environ |= {"ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_IP": "127.0.0.1"}
    with running(sys.executable, MASTER, "--core", "-p", str(port)):
        time.sleep(1.0)
        moving, fixed, sent = transforms()
    found = {one.header.stamp.to_nsec(): one for one in moving}
    joints = {(one.header.frame_id, one.child_frame_id) for one in [*moving, *fixed]}
    assert joints == {("ground", "table"), ("table", "specimen")}, joints
    worst = max(abs(found[stamp].transform.translation.x - x) for stamp, x in sent.items() if stamp in found)
    came = len(found.keys() & sent.keys())
    print(f"{came} of {COUNT} positions came out as transforms ground → table, largest difference {worst:g} m")
    return 0 if came == COUNT and worst == 0.0 else 1


if __name__ == "__main__":
    sys.exit(main())

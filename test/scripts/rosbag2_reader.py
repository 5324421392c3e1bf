"""What rosbag2's own code accepts of our recordings: metadata.yaml, and every message through its plugin for MCAP.

    python test/scripts/rosbag2_reader.py --sources FOLDER [RECORDING …]

FOLDER has checkouts of ros2/rosbag2, ros2/rclcpp, ros2/rcl, ros2/rmw, ros2/rcutils, ros2/rcpputils and foxglove/mcap,
each under its name. rosbag2's reader of metadata and its storage plugin are compiled from there, as they are, with g++
and Debian's libyaml-cpp-dev, libzstd-dev and liblz4-dev, against the libraries of the ROS 2 that this Python has; the
headers below stand in for what reading does not use. Without a RECORDING two are written, plain and zstd. Ends with 3,
and says so, where there are no sources; with 0 where every message that was told was read.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from shake_ros.recordings.bags.writer import BagWriter
from shake_ros.ros.conversions import codec
from shake_ros.ros.interface import IMU, JOINT_STATES

NONE = 3  # exit status without the sources
READER = Path(__file__).with_suffix(".cpp")
OVERFLOWS = ("add_will_over", "add_will_under", "sub_will_over", "sub_will_under")
STAND_INS = {  # what rosbag2 includes and reading does not use, or what a package generates
    **{
        f"builtin_interfaces/msg/{name.lower()}.hpp": f"""#include <cstdint>
namespace builtin_interfaces::msg {{ struct {name} {{ int32_t sec; uint32_t nanosec; }}; }}"""
        for name in ("Time", "Duration")
    },
    "rcl/logging_rosout.h": '#include "rmw/types.h"\nstatic const rmw_qos_profile_t rcl_qos_profile_rosout_default{};',
    "rclcpp/logging.hpp": "#define RCLCPP_WARN_ONCE(...)",
    "rclcpp/clock.hpp": "",
    "rclcpp/utilities.hpp": "#include <cstdlib>\nnamespace rclcpp {\n"
    + "".join(f"template<class T> bool {one}flow(T, T) {{ std::abort(); }}\n" for one in OVERFLOWS)
    + "}",
    "rclcpp/node_interfaces/node_graph_interface.hpp": '#include "rclcpp/qos.hpp"\nnamespace rclcpp {\n'
    "struct TopicEndpointInfo { QoS qos{1}; const QoS & qos_profile() const { return qos; } };\n}",
    "rcutils/logging_macros.h": '#include <cstdio>\n#include "rcutils/logging.h"\n'
    + "".join(
        f'#define RCUTILS_LOG_{level}_NAMED(name, ...) (std::fprintf(stderr, __VA_ARGS__), std::fputs("\\n", stderr))\n'
        for level in ("DEBUG", "INFO", "WARN", "ERROR")
    ),
    "pluginlib/class_list_macros.hpp": '#define PLUGINLIB_EXPORT_CLASS(Plugin, Base) extern "C" Base * make_storage() '
    "{ return new Plugin(); }",
}
INCLUDES = (
    "rosbag2/rosbag2_storage", "rosbag2/rosbag2_storage_mcap", "rclcpp/rclcpp", "rcl/rcl", "rmw/rmw", "rcutils",
    "rcpputils", "mcap/cpp/mcap",
)  # fmt: skip
STORAGE = "rosbag2/rosbag2_storage/src/rosbag2_storage"
SOURCES = (
    *(f"{STORAGE}/{name}.cpp" for name in ("qos", "metadata_io", "ros_helper", "storage_options", "base_io_interface")),
    "rclcpp/rclcpp/src/rclcpp/qos.cpp", "rclcpp/rclcpp/src/rclcpp/duration.cpp",
    "rosbag2/rosbag2_storage_mcap/src/mcap_storage.cpp",
)  # fmt: skip
# what rosbag2_storage_mcap's CMakeLists.txt defines for the rosbag2 of its own tree
DEFINED = ("HAS_YAML_HPP", "HAS_STORAGE_OPTIONS", "HAS_UPDATE_METADATA", "HAS_SET_READ_ORDER")
LIBRARIES = ("rcutils", "rmw", "rcpputils", "yaml-cpp", "zstd", "lz4")
# what rclcpp's own files ask for and reading does not reach
UNREACHED = """#define MCAP_IMPLEMENTATION
#include <mcap/mcap.hpp>
#include <cstdlib>
#include "rclcpp/duration.hpp"
#include "rmw/qos_profiles.h"
namespace rclcpp {
builtin_interfaces::msg::Time convert_rcl_time_to_sec_nanos(const rcl_time_point_value_t &) { std::abort(); }
}
extern "C" rmw_ret_t rmw_qos_profile_check_compatible(
  const rmw_qos_profile_t, const rmw_qos_profile_t, rmw_qos_compatibility_type_t *, char *, size_t) { std::abort(); }
"""


def prefixes() -> list[str]:
    """Where the libraries of a ROS 2 may be: this Python's wheels, or what is sourced."""
    return [sys.prefix, *os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]


def build(sources: Path, folder: Path) -> Path:
    """Compile the reader into `folder`."""
    for name, text in STAND_INS.items():
        path = folder / "stand_ins" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(f"#pragma once\n{text}\n")
    (folder / "unreached.cpp").write_text(UNREACHED)
    found = next((Path(one) / "lib" for one in prefixes() if (Path(one) / "lib" / "librcutils.so").exists()), None)
    if found is None:
        raise SystemExit("no librcutils.so in the ROS 2 of this Python")
    program = folder / "rosbag2_reader"
    subprocess.run(
        [
            "g++", "-std=c++17", "-O1", "-w", f"-I{folder / 'stand_ins'}",
            *(f"-I{sources / one / 'include'}" for one in INCLUDES),
            *(f"-DROSBAG2_STORAGE_MCAP_{one}" for one in DEFINED),
            READER, folder / "unreached.cpp", *(sources / one for one in SOURCES),
            "-o", program, f"-L{found}", *(f"-l{one}" for one in LIBRARIES), f"-Wl,-rpath,{found}",
            "-Wl,--allow-shlib-undefined",
        ],
        check=True,
    )  # fmt: skip
    return program


def write(path: Path, compression: str, samples: int = 3000) -> Path:
    """A recording of position and acceleration at 1 kHz."""
    kinds = {JOINT_STATES: "sensor_msgs/msg/JointState", IMU: "sensor_msgs/msg/Imu"}
    with BagWriter(path, compression) as bag:
        numbers = {topic: bag.add_topic(f"/shake/{topic.name}", kind) for topic, kind in kinds.items()}
        for k in range(samples):
            stamp = 1_000_000_000 + k * 1_000_000
            for topic, number in numbers.items():
                bag.write(number, stamp, codec(topic).encode(stamp, (math.sin(0.01 * k),)))
    return path


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--sources", type=Path, help="folder of the checkouts")
    parser.add_argument("recordings", type=Path, nargs="*")
    given = parser.parse_args()
    if given.sources is None or not (given.sources / "rosbag2").is_dir():
        print("NOT TESTED: no sources of rosbag2; --sources FOLDER", file=sys.stderr)
        return NONE
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = build(given.sources, folder)
        own = [] if given.recordings else [write(folder / (one or "plain"), one) for one in ("", "zstd")]
        whole = True
        for recording in given.recordings or own:
            done = subprocess.run([program, recording], capture_output=True, text=True, check=False)
            print(f"{recording}: {done.stdout.strip() or done.stderr.strip()}")
            if done.stderr or done.returncode:
                whole = False
                continue
            said = json.loads(done.stdout)
            told = said["told"] == said["read"] and all(topic[2] == topic[3] for topic in said["topics"])
            whole &= told and not said["reversed"] and not said["outside"]
    print("rosbag2 reads every message that was told, in order" if whole else "NOT as it should be")
    return 0 if whole else 1


if __name__ == "__main__":
    sys.exit(main())

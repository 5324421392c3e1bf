"""The loop that runs nodes keeps nothing of what has passed."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from shake_ros.ros.loop import NodeLoop, ros_context
from shake_ros.settings import config_folder

LOOKS = 8000
MOST = 0.1  # [MiB]


def resident() -> float:
    """Resident memory of this process [MiB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS:")) / 1024.0


def test_looking_at_services_between_ticks_does_not_grow_the_memory(ros_domain) -> None:
    with ros_context([], domain_id=ros_domain) as context:
        loop = NodeLoop(context)
        for _ in range(LOOKS // 8):
            loop.attend(0.0)
        before = resident()
        for _ in range(LOOKS):
            loop.attend(0.0)
        assert resident() - before < MOST
        loop.close()


def test_a_stopped_loop_does_not_wait_any_more(ros_domain) -> None:
    with ros_context([], domain_id=ros_domain) as context:
        loop = NodeLoop(context)
        loop.stop()
        loop.attend(30.0)
        loop.close()


@pytest.mark.parametrize("name", ["fastdds", "fastdds_network", "fastdds_udp"])
def test_nodes_of_one_process_do_not_call_into_each_other(name: str) -> None:
    settings = ElementTree.parse(config_folder() / f"{name}.xml").getroot()
    assert [e.text for e in settings.iter() if e.tag.endswith("intraprocess_delivery")] == ["OFF"]

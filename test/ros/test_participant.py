"""The number of a node among the processes of its domain."""

from __future__ import annotations

import socket
from pathlib import Path

from shake_ros.ros.participant import BASE, DATA, DISCOVERY, GAIN, LOOPBACK, NUMBERS, STEP, choose, domain_of


def first_port(domain: int) -> int:
    return BASE + GAIN * domain


def test_number_that_a_process_has_or_a_killed_one_has_left_behind_is_not_chosen(ros_domain, tmp_path: Path) -> None:
    left = tmp_path / f"fastdds_port{first_port(ros_domain) + DATA + STEP * 7}"
    left.touch()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind((LOOPBACK, first_port(ros_domain) + DISCOVERY + STEP * 30))
        chosen = {choose(ros_domain, tmp_path) for _ in range(NUMBERS)}
    assert chosen == set(range(NUMBERS)) - {7, 30}
    assert left.exists()


def test_where_the_killed_have_left_every_number_one_of_them_is_freed(ros_domain, tmp_path: Path) -> None:
    for number in range(NUMBERS):
        (tmp_path / f"fastdds_port{first_port(ros_domain) + DATA + STEP * number}").touch()
        (tmp_path / f"fastdds_port{first_port(ros_domain) + DATA + STEP * number}_el").touch()
    number = choose(ros_domain, tmp_path)
    assert not list(tmp_path.glob(f"*{first_port(ros_domain) + DATA + STEP * number}*"))
    assert len(list(tmp_path.iterdir())) == 2 * (NUMBERS - 1)


def test_domain_is_the_given_one_or_that_of_the_environment(monkeypatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "12")
    assert (domain_of(5), domain_of(None)) == (5, 12)
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert domain_of(None) == 0

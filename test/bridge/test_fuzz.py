"""A short run of benchmarks/bridge/fuzz.py: broken datagrams at both ends, through real sockets."""

from __future__ import annotations

from benchmarks.bridge.fuzz import fuzz

COUNT = 3000


def test_broken_datagrams_are_refused_and_counted_at_both_ends() -> None:
    taken, by_target, by_host = fuzz(COUNT, seed=4)
    assert taken < COUNT // 100
    for rejected in (by_target, by_host):
        assert sum(rejected.values()) > 0.95 * COUNT
        assert all(rejected[reason] for reason in ("size", "magic", "version", "kind", "tag", "session", "replay"))

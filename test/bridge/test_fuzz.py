"""A short run of benchmarks/fuzz_bridge.py: broken datagrams at both ends, through real sockets."""

from __future__ import annotations

import importlib.util
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "benchmarks" / "fuzz_bridge.py"
COUNT = 3000


def test_broken_datagrams_are_refused_and_counted_at_both_ends() -> None:
    specification = importlib.util.spec_from_file_location("fuzz_bridge", SCRIPT)
    assert specification is not None and specification.loader is not None
    script = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(script)
    taken, by_target, by_host = script.fuzz(COUNT, seed=4)
    assert taken < COUNT // 100
    for rejected in (by_target, by_host):
        assert sum(rejected.values()) > 0.95 * COUNT
        assert all(rejected[reason] for reason in ("size", "magic", "version", "kind", "tag", "session", "replay"))

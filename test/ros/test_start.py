"""What a node brings along when it starts: nothing that only figures, fits and recordings in files need."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from shake_ros.entry_points import NODES

ROOT = Path(__file__).resolve().parents[2]
SLOW = ("matplotlib", "pandas", "scipy.signal", "scipy.stats", "scipy.optimize", "scipy.integrate", "scipy.interpolate")


@pytest.mark.parametrize("name", NODES)
def test_a_node_starts_without_what_is_slow_to_import(name: str) -> None:
    program = f"import sys, {NODES[name].module}\nprint(*(m for m in {SLOW} if m in sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert loaded.returncode == 0, loaded.stderr
    assert loaded.stdout.split() == []

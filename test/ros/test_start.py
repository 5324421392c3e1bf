"""What a node brings along when it starts: nothing that only figures, fits and recordings in files need."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from shake_ros.entry_points import NODES

ROOT = Path(__file__).resolve().parents[2]
SLOW = ("matplotlib", "pandas", "scipy.signal", "scipy.stats", "scipy.optimize", "scipy.integrate", "scipy.interpolate")


def test_no_node_brings_what_is_slow_to_import() -> None:
    program = (
        "import importlib, sys\n"
        f"for name, module in {[(name, node.module) for name, node in NODES.items()]}:\n"
        f"    importlib.import_module(module); print(name, *(m for m in {SLOW} if m in sys.modules))"
    )
    loaded = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert loaded.returncode == 0, loaded.stderr
    assert loaded.stdout.splitlines() == list(NODES)

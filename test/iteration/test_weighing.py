"""The moved mass from the forces of a run."""

from __future__ import annotations

import numpy as np
import pytest

from shake_ros.iteration.table import weigh
from shake_ros.physics.plant.simulation import run
from shake_ros.quantities import ShakeError
from shake_ros.settings import load_table


@pytest.mark.parametrize("load", [0.0, 500.0])
def test_a_simulated_table_is_weighed_by_its_pressures(load: float) -> None:
    # large dry friction, and a soft zone: what the command does to the motion does not matter
    table = load_table("bergamo_measured").with_values({"body.specimen_mass": load})
    time = np.arange(4000) / 1000
    out = run(table, 0.2 * np.sin(2 * np.pi * (1.0 + time) * time), 0.001)
    body = table.body
    force = body.piston_area * (out[:, 3] - body.area_ratio * out[:, 4])
    found = weigh(force, out[:, 2], out[:, 0], 0.001)
    assert found == pytest.approx(table.moved_mass, rel=0.02)


def test_a_run_at_rest_is_not_weighed() -> None:
    with pytest.raises(ShakeError, match="hardly moves"):
        weigh(np.zeros(2000), np.zeros(2000), np.zeros(2000), 0.001)

"""Free runs of a table that something beside its command shakes, on recordings of a table simulated apart."""

from __future__ import annotations

import numpy as np
import pytest
from hidden_table import TRUE, record

from shake_ros.fit.declared_model import FULL, Compared
from shake_ros.fit.likelihood import FreeRuns, Levels, ShakenRuns
from shake_ros.fit.nuisances.explained_band import limited
from shake_ros.fit.recording_problem import CALM, RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.settings import load_table

TABLE = load_table("bergamo").with_values(TRUE)
BAND = 12.0  # [Hz]


@pytest.fixture(scope="module")
def recorded() -> list[Record]:
    """Two recordings, compared below a frequency alone."""
    runs = [record(seed, 6.0) for seed in (3, 4)]
    made = [Record(f"run{i}", 0.001, r.commands, r.position, r.acceleration, run=i) for i, r in enumerate(runs)]
    return limited(made, BAND, made)


def test_a_model_may_leave_less_than_the_linear_filter_that_marks_the_noise(recorded: list[Record]) -> None:
    vector = TABLE.vector()
    of_noise, of_mark = (runs(recorded, FULL, Levels()).tuned(vector, ("position",)) for runs in (FreeRuns, ShakenRuns))
    assert of_noise.levels.position == 1.0
    assert of_mark.levels.position < 0.8
    worse = TABLE.with_values({"valve.flow_coefficient": 1.1 * TABLE.value("valve.flow_coefficient")}).vector()
    right, wrong = (of_mark.tuned(v, ("position",)).log_likelihood().sum() for v in (vector, worse))
    assert right > wrong + 10.0


def test_a_run_that_rings_beyond_the_band_costs_by_how_much_the_table_rings_there(recorded: list[Record]) -> None:
    first = recorded[0]
    assert first.explained is not None
    time = np.arange(len(first.commands)) * first.sample_time
    ringing = 3.0 * first.explained.beyond * np.sin(2.0 * np.pi * 45.0 * time)

    class Ringing(type(FULL)):  # type: ignore[misc]
        """The full model with ringing that no command explains."""

        def compared(self, vectors: np.ndarray, r: Record, injection: float = 0.0) -> Compared:
            found = FULL.compared(vectors, r, injection)
            return found._replace(acceleration=found.acceleration + ringing)

    vector = TABLE.vector()[None, :]
    calm, rings = (np.sum(RecordingProblem([first], m).residuals(vector) ** 2) for m in (FULL, Ringing()))
    assert rings - calm == pytest.approx(0.5 * (3.0 * CALM) ** 2 * len(time[first.start :: first.every]), rel=0.1)

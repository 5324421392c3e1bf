"""A command recorded after it acted, on tables of another simulator: found and moved; in time, it is left alone."""

from __future__ import annotations

import numpy as np
import pytest
from foreign_run import foreign_run

from shake_ros.core.identification.late_command import LEFT, earlier, in_time, response_delay
from shake_ros.core.identification.nuisances import prepared
from shake_ros.core.identification.recordings import Record

LATE = 4  # samples of 2 ms


def late(record: Record, samples: int) -> Record:
    commands = np.concatenate([np.zeros(samples), record.commands[:-samples]])
    return Record(record.name, record.sample_time, commands, record.position, record.acceleration)


@pytest.mark.parametrize("seed", [425, 422])
def test_delay_below_zero_is_seen_to_a_fraction_of_a_sample(seed: int) -> None:
    before, after = response_delay([foreign_run(seed)]), response_delay([late(foreign_run(seed), LATE)])
    assert before > 0.0
    assert after == pytest.approx(before - 0.002 * LATE, abs=2e-4)


def test_late_command_is_moved_to_where_a_delay_is_left() -> None:
    data = in_time(prepared([late(foreign_run(422), LATE)], [late(foreign_run(422), LATE)]))
    assert LEFT - 2e-4 < response_delay(data.estimation) < LEFT + 0.002 + 2e-4
    assert data.ahead > 0.002 * LATE
    assert len(data.validation[0].commands) == len(foreign_run(422).commands) - round(data.ahead / 0.002)
    assert "moves before its recorded command" in data.promptness()


def test_command_in_time_stays() -> None:
    data = prepared([foreign_run(425)], [])
    assert in_time(data) is data
    assert data.promptness() == ""


def test_earlier_by_whole_samples_is_the_command_to_the_bit() -> None:
    record = foreign_run(425)
    moved = earlier(record, 0.004)
    assert np.array_equal(moved.commands, record.commands[2:])
    assert moved.standing == record.commands[1]
    assert np.array_equal(moved.position, record.position[:-2])

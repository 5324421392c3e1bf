"""A command recorded after it acted, on tables of another simulator: found and moved; in time, it is left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from foreign_run import foreign_run

from shake_ros.fit.nuisances.prepared import prepared
from shake_ros.fit.records import Record
from shake_ros.fit.start.late_command import LEFT, earlier, in_time, lead, moved_ahead

LATE = 6  # samples of 2 ms


def late(record: Record, samples: int) -> Record:
    commands = np.concatenate([np.zeros(samples), record.commands[:-samples]])
    return Record(record.name, record.sample_time, commands, record.position, record.acceleration)


@pytest.mark.parametrize("seed", [425, 422])
def test_lead_is_seen_to_a_fraction_of_a_sample(seed: int) -> None:
    before, after = lead([late(foreign_run(seed), LATE)]), lead([late(foreign_run(seed), LATE + 3)])
    assert before > 0.0
    assert after == pytest.approx(before + 0.006, abs=2e-4)


def test_late_command_is_moved_to_where_a_delay_is_left() -> None:
    recorded = late(foreign_run(422), LATE)
    data = in_time(prepared([recorded], [recorded]))
    assert LEFT <= data.ahead - lead([recorded]) < LEFT + 0.002
    assert lead(data.estimation) == 0.0
    assert data.ahead > 0.002 * LATE
    assert len(data.validation[0].commands) == len(foreign_run(422).commands) - round(data.ahead / 0.002)
    assert "moves before its recorded command" in data.promptness()


def test_command_is_left_alone_where_damping_explains_the_response_as_well_as_a_lead() -> None:
    time = np.arange(0.0, 30.0, 0.005)
    command = sum(0.1 * np.sin(2.0 * np.pi * f * time + f**2) for f in np.arange(0.75, 5.0, 0.5))  # far below 50 Hz
    velocity = np.convolve(command, np.full(4, 0.25))[: len(time)]
    noise = np.random.default_rng(1).normal(0.0, 1e-5, len(time))
    record = Record("slow", 0.005, command, np.cumsum(velocity) * 0.005 + noise, None)
    assert lead([record]) == 0.0


def test_command_and_accelerometer_that_are_late_alike_are_called_an_early_position() -> None:
    data = prepared([foreign_run(422)], [])
    late = [replace(r, delay=0.0087) for r in data.estimation]
    data = moved_ahead(replace(data, estimation=late), 0.0087)
    (change,) = [c for c in data.changes() if "ms" in c]
    assert change == "position earlier than command and accelerometer by 8.70 ms; both were moved to it"


def test_command_in_time_stays() -> None:
    data = prepared([foreign_run(425)], [])
    assert in_time(data) is data
    assert data.promptness() == ""


def test_earlier_by_whole_samples_is_the_command_to_the_bit() -> None:
    record = foreign_run(425)
    moved = earlier(record, 0.004)
    assert np.array_equal(moved.commands, record.commands[2:])
    assert moved.command_before == record.commands[1]
    assert np.array_equal(moved.position, record.position[:-2])

"""What each fault makes of the samples of a topic."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from shake_ros.quantities import ShakeError
from shake_ros.safety.faults import MessageFaultParameters, MessageFaults

MS = 1_000_000
COUNT = 4000


def carried(seed: int = 3, **faults: float) -> list[tuple[int, tuple[float, ...]]]:
    """Samples (k ms; k, 2k) through faults."""
    channel = MessageFaults(seed)
    channel.apply(MessageFaultParameters(**faults))
    return [one for k in range(COUNT) for one in channel.carry(k * MS, (float(k), 2.0 * k))]


def stamps(samples: list[tuple[int, tuple[float, ...]]]) -> list[int]:
    return [stamp // MS for stamp, _ in samples]


def test_without_a_fault_everything_passes_unchanged() -> None:
    assert carried() == [(k * MS, (float(k), 2.0 * k)) for k in range(COUNT)]


def test_delayed_sample_leaves_with_the_first_that_is_late_enough_and_none_is_lost_after_it() -> None:
    channel = MessageFaults(1)
    channel.apply(MessageFaultParameters(delay=0.0205))
    left = {k: stamps(channel.carry(k * MS, (1.0,))) for k in range(60)}
    assert all(not left[k] for k in range(21)) and left[21] == [0] and left[59] == [38]
    channel.apply(MessageFaultParameters())
    assert stamps(channel.carry(60 * MS, (1.0,))) == list(range(39, 61))


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_dropped_and_doubled_samples_have_their_share(share) -> None:
    spread = 4.0 * math.sqrt(share * (1.0 - share) / COUNT)  # four standard deviations of a binomial share
    assert len(carried(drop=share)) / COUNT == pytest.approx(1.0 - share, abs=spread)
    twice = [stamp for stamp, times in Counter(stamps(carried(duplicate=share))).items() if times == 2]
    assert len(twice) / COUNT == pytest.approx(share, abs=spread)


def test_reordered_samples_change_places_with_the_next_and_none_is_lost() -> None:
    order = stamps(carried(reorder=0.2))
    assert sorted(order) == list(range(COUNT))[: len(order)] and len(order) >= COUNT - 1
    steps = Counter(np.diff(order).tolist())
    assert set(steps) <= {-1, 1, 2, 3} and steps[-1] > 0.1 * COUNT
    assert stamps(carried(reorder=1.0))[:4] == [1, 0, 3, 2]


def test_frozen_numbers_stay_under_new_stamps_until_the_fault_is_gone() -> None:
    channel = MessageFaults(1)
    channel.carry(0, (1.0, 5.0))
    channel.apply(MessageFaultParameters(freeze=True))
    frozen = [channel.carry(k * MS, (2.0 + k, 6.0)) for k in (1, 2, 3)]
    assert frozen == [[(k * MS, (3.0, 6.0))] for k in (1, 2, 3)]
    channel.apply(MessageFaultParameters())
    assert channel.carry(4 * MS, (9.0, 9.0)) == [(4 * MS, (9.0, 9.0))]
    channel.apply(MessageFaultParameters(freeze=True))
    assert channel.carry(5 * MS, (7.0, 7.0)) == [(5 * MS, (7.0, 7.0))]


def test_jump_hits_one_sample_and_another_when_it_is_set_anew() -> None:
    channel = MessageFaults(1)
    seen = []
    for k in range(6):
        if k in (1, 4):
            channel.apply(MessageFaultParameters(jump=0.5 * k))
        seen.append(channel.carry(k * MS, (0.0,))[0][1][0])
    assert seen == [0.0, 0.5, 0.0, 0.0, 2.0, 0.0]


def test_bias_and_noise_hit_the_first_number_alone() -> None:
    numbers = np.array([values for _, values in carried(bias=2.0, noise=0.3)])
    wrong = numbers[:, 0] - np.arange(COUNT)
    assert wrong.mean() == pytest.approx(2.0, abs=4.0 * 0.3 / math.sqrt(COUNT))
    assert wrong.std() == pytest.approx(0.3, rel=4.0 / math.sqrt(2.0 * COUNT))
    assert np.array_equal(numbers[:, 1], 2.0 * np.arange(COUNT))


def test_share_of_samples_is_not_a_number() -> None:
    nan = sum(math.isnan(values[0]) for _, values in carried(nan=0.25))
    assert nan / COUNT == pytest.approx(0.25, abs=4.0 * math.sqrt(0.25 * 0.75 / COUNT))
    assert all(math.isnan(values[0]) for _, values in carried(nan=1.0))


def test_same_seed_gives_the_same_and_another_seed_another() -> None:
    faults = {"drop": 0.1, "duplicate": 0.1, "reorder": 0.1, "noise": 0.1}
    assert carried(5, **faults) == carried(5, **faults) != carried(6, **faults)


@pytest.mark.parametrize("wrong", [{"drop": 1.5}, {"delay": -1.0}, {"noise": math.nan}, {"melt": 1.0}])
def test_fault_out_of_its_range_is_refused(wrong) -> None:
    with pytest.raises(ShakeError, match=next(iter(wrong))):
        MessageFaultParameters().replace(**wrong)

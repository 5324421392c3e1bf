"""What of a residual is predictable: shares known from closed forms of linear systems with known noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from shake_ros.explain.account import Account, Left, accounts, together, verdict
from shake_ros.fit.nuisances.equal_commands import repeated_and_different, repeats

DT, SECONDS = 2e-3, 24.0
N = round(SECONDS / DT)
KEPT, DRIVE, WHITE = 0.95, 0.2, 0.5  # of the AR(1) process noise, whose mean square is DRIVE²/(1 − KEPT²)
PROCESS = DRIVE**2 / (1.0 - KEPT**2)


def command(rng, n=N):
    """A command below 20 Hz."""
    u = lfilter([0.2], [1.0, -0.8], lfilter([0.2], [1.0, -0.8], rng.standard_normal(n)))
    return u / np.std(u)


def process(rng, n=N):
    return lfilter([DRIVE], [1.0, -KEPT], rng.standard_normal(n))


def left(name, rng, u, missing, noise=WHITE, held_out=True):
    """A residual: what the model lacks, AR(1) process noise, white sensor noise."""
    values = missing + process(rng, len(u)) + WHITE * rng.standard_normal(len(u))
    return Left(name, held_out, "acceleration", values, u, 0, DT, noise)


def told(missing, seed=1):
    """What is told of a held-out residual, the filter fitted on two others."""
    rng = np.random.default_rng(seed)
    commands = [command(rng) for _ in range(3)]
    rests = [left(f"r{k}", rng, u, missing(u), held_out=k == 2) for k, u in enumerate(commands)]
    return accounts(rests[:2], rests[2:])[-1]


def linear(u):
    """What a mode that the model lacks would answer."""
    return lfilter([0.0, 0.3], [1.0, -1.6, 0.8], u)


def test_the_share_that_a_linear_system_leaves_is_told_beside_process_noise():
    missing = np.var(linear(command(np.random.default_rng(2), 200000)))
    total = missing + PROCESS + WHITE**2
    found = told(linear)
    assert found.filtered == pytest.approx(missing / total, abs=0.06)
    assert found.coherent == pytest.approx(missing / total, abs=0.06)
    assert found.noise_share == pytest.approx(WHITE**2 / total, abs=0.03)
    assert found.unknown == pytest.approx(PROCESS / total, abs=0.08)
    assert found.repeated is None


def test_process_noise_alone_is_not_known_to_be_predictable():
    found = [told(lambda u: 0.0 * u, seed) for seed in range(5)]
    total = PROCESS + WHITE**2
    assert all(f.filtered == 0.0 for f in found)
    assert all(f.coherent < 0.06 for f in found)
    assert np.mean([f.unknown for f in found]) == pytest.approx(PROCESS / total, abs=0.05)


def test_an_even_function_of_the_command_is_seen_by_the_filter_and_not_by_coherence():
    found = told(lambda u: 2.0 * np.abs(u))
    share = 4.0 * (1.0 - 2.0 / np.pi)
    share /= share + PROCESS + WHITE**2
    assert found.filtered == pytest.approx(share, abs=0.08)
    assert found.coherent < 0.1


def test_what_equal_commands_do_not_repeat_is_the_process_noise():
    rng = np.random.default_rng(3)
    period = command(rng, 2000)
    u = np.tile(period, 10)
    tiled = left("periods", rng, u, np.tile(linear(np.tile(period, 2))[2000:], 10))
    missing = np.var(tiled.values) - PROCESS - WHITE**2
    total = missing + PROCESS + WHITE**2
    (found,) = accounts([], [tiled])
    assert found.repeated == pytest.approx(missing / total, abs=0.05)
    assert found.different == pytest.approx(PROCESS / total, abs=0.05)
    assert found.filtered is None


def test_two_recordings_of_one_command_are_found_though_one_begins_later():
    rng = np.random.default_rng(4)
    u = command(rng)
    rests = [left("early", rng, u[:-700], 0.0, held_out=False), left("late", rng, u[700:], 0.0, held_out=False)]
    found = accounts(rests, [left("other", rng, command(rng), 0.0)])
    shares = {f.name: f.different for f in found}
    assert shares["other"] is None
    assert shares["early"] == shares["late"] == pytest.approx(PROCESS / (PROCESS + WHITE**2), abs=0.06)
    (pair,) = repeats([r.driven for r in rests], [DT, DT])
    assert (pair.here.start, pair.there.start) == (700, 0)


def test_other_commands_are_not_taken_for_equal_ones():
    rng = np.random.default_rng(5)
    assert repeats([command(rng) for _ in range(4)], [DT] * 4) == []
    u = command(rng)
    assert repeats([u, u], [DT, 2.0 * DT]) == []


def test_the_first_period_settles_where_two_follow_it():
    rng = np.random.default_rng(6)
    (pair,) = repeats([np.tile(rng.standard_normal(1000), 3)], [DT])
    assert (pair.here, pair.there) == (slice(1000, 2000), slice(2000, 3000))


def test_the_shared_and_the_differing_part_add_up():
    rng = np.random.default_rng(7)
    a, b = rng.standard_normal((2, 500))
    assert sum(repeated_and_different(a, b)) == pytest.approx(0.5 * (np.var(a) + np.var(b)))


def test_a_verdict_names_each_share_once():
    p = Account("hold", True, "acceleration", 4.0, 1.0, 0.1, 0.3)
    assert verdict([p]) == (
        "of the acceleration's residual of 2.00 × the noise 25 % is sensor noise, 30 % a filter of the command would "
        "still predict, 10 % is coherent with the command, the rest of 45 % is not known to be predictable"
    )
    assert p.least_ratio == pytest.approx(2.0 * np.sqrt(0.7))
    assert verdict([]) == ""


def test_the_longest_piece_of_a_recording_is_tested_and_says_what_predicts_it():
    rng = np.random.default_rng(8)
    long, short = (
        Left("hold", True, "acceleration", WHITE * rng.standard_normal(n), command(rng, n), 0, DT, WHITE)
        for n in (6000, 1000)
    )
    (noise,) = accounts([], [short, long])
    assert noise.predicted_by == "nothing"
    assert noise.shape.auto_bound == pytest.approx(2.5758 / np.sqrt(6000), rel=1e-4)
    u = command(rng)
    (both,) = accounts([], [left("hold", rng, u, linear(u))])
    assert both.predicted_by == "the command and its past"
    (untested,) = accounts([], [replace(short, values=short.values[:100])])
    assert untested.predicted_by == "not tested"


def test_shares_of_pieces_weigh_by_their_mean_squares():
    one, two = (Account("hold", True, "velocity", square, 0.5, share) for square, share in ((1.0, 0.5), (3.0, 0.1)))
    both = together([one, two])
    assert both.mean_square == 2.0
    assert both.coherent == pytest.approx((0.5 + 0.3) / 4.0)
    assert both.ratio == pytest.approx(np.sqrt(2.0) / 0.5)

"""The page of `schedule` says whether the networks beat one constant set, and shows how they learnt."""

from __future__ import annotations

import numpy as np

from shake_ros.fit.records import Record
from shake_ros.thesis.network import SeedResult, Split, Training, first_network
from shake_ros.thesis.schedule import (
    ScheduleComparison,
    ValidationRuns,
    answer,
    learning_chart,
    verdict,
)

DRAW = np.random.default_rng(1)
NETWORK = first_network(DRAW.uniform(size=(20, 2)), DRAW.uniform(size=(20, 3)), 1, (3, 3))
CURVES = np.array([[1.5, 1.2, 1.3], [0.5, 0.7, 0.8], [0.2, 0.9, 1.1]])
TRAINING = Training(NETWORK, Split.drawn(20, 1), CURVES, 1)


def seed(number: int, network: float) -> SeedResult:
    errors = {"one set": (0.06, 0.30), "network": (0.04, network), "fit to the window": (0.03, 0.15)}
    return SeedResult(number, TRAINING, 0.6, errors)


def test_verdict_counts_the_seeds_that_win() -> None:
    assert "beat one constant set (2 of 2 seeds)" in verdict([seed(1, 0.2), seed(2, 0.25)])
    lost = verdict([seed(1, 0.2), seed(2, 0.5)])
    assert "do not always beat one constant set (1 of 2 seeds)" in lost
    assert "35.00 % with them" in lost


def test_weights_that_are_kept_are_marked_in_the_curves() -> None:
    chart = learning_chart(TRAINING)
    assert [len(series.values) for series in chart.panels[0].series] == [3, 3, 3]
    assert "epoch 1" in chart.caption


def test_the_page_has_every_seed_and_both_charts() -> None:
    time = np.arange(3000) * 1e-3
    record = Record("run", 1e-3, 0.1 * np.sin(6.0 * time), 0.01 * np.sin(6.0 * time), np.cos(6.0 * time))
    runs = {name: np.zeros((3000, 7)) for name in ("one set", "schedule", "soft_zone")}
    found = ScheduleComparison([seed(1, 0.2), seed(7, 0.25)], [ValidationRuns(record, runs)], None)
    page = found.page
    text = page.render()
    assert "100 sigmoid neurons" in text
    assert ">7<" in text
    assert len(page.charts) == 2


def test_the_page_begins_with_the_model_that_leaves_the_least() -> None:
    left = {"run": (0.4, 0.5, 0.05), "sum": (0.2, 0.1, 0.03)}
    models = ("one set", "schedule", "soft_zone")
    errors = {run: {m: {"acceleration": e} for m, e in zip(models, of, strict=True)} for run, of in left.items()}
    assert answer(errors) == (
        "soft_zone leaves 4.00 % of the acceleration unexplained, against 30.00 % with one set, 30.00 % with schedule."
    )

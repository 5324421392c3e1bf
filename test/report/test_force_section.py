"""The section on the force that a model lacks: one sentence where it is zero, sizes and charts where it is not."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest
from closed_loops import command
from pages import Reader, read_page

from shake_ros.api.fitted import LatentForces
from shake_ros.explain.force_kinds import ForceKinds
from shake_ros.explain.latent_force import LatentForce
from shake_ros.fit.declared_model import FULL, DeclaredModel
from shake_ros.fit.start.unknown_model import UnknownModel
from shake_ros.report.chart import static_figure
from shake_ros.report.close_loop_page import against_chart, force_chart, force_section
from shake_ros.report.page import Page
from shake_ros.report.text import force_text, largest_force

NOON = datetime(2026, 1, 2, 12, 0, tzinfo=timezone.utc)
TIME = np.arange(6000) * 1e-3
POSITION = 0.02 * np.sin(2.0 * np.pi * TIME)


def force(name: str = "hold", held_out: bool = True, size: float = 300.0, zero: bool = False) -> LatentForce:
    """A force of position in a slow sine."""
    velocity = np.gradient(POSITION, 1e-3)
    kinds = ForceKinds(zero, 0.0 if zero else 0.8, 9.0, (), {} if zero else {"position": 0.9}, {}, 0.0)
    return LatentForce(
        recording=name,
        held_out=held_out,
        time=TIME,
        force=-size / 0.02 * POSITION,
        deviation=np.full(len(TIME), 10.0),
        unit="N",
        bandwidth=31.0,
        of_inertia=0.123,
        left=(5.0, 1.0),
        kinds=kinds,
        known={"position": POSITION, "velocity": velocity, "direction": np.sign(velocity)},
        band=0.9,
        near_noise=1.5,
    )


def page_of(forces: list[LatentForce], model: DeclaredModel = FULL) -> tuple[Page, Reader]:
    page = Page("Title", "Lead")
    force_section(page, forces, model)
    return page, read_page(page.render(NOON))


def test_zero_force_is_one_sentence() -> None:
    page, reader = page_of([force(zero=True, size=5.0), force("learn", held_out=False, zero=True, size=4.0)])
    assert "The force that the model lacks is zero within its 90 % band of every validation recording." in reader.words
    assert not page.charts


def test_force_that_is_there_has_its_size_its_kind_and_three_charts() -> None:
    page, reader = page_of([force(zero=True, size=5.0), force("other"), force("learn", held_out=False, size=900.0)])
    assert "212 N rms (12.3 % of the force of inertia), at most 300 N, in other; it follows position." in reader.words
    assert [chart.name for chart in page.charts] == ["force_other", "force_velocity_other", "force_position_other"]
    rows = {row[0]: row[1:] for row in reader.rows}
    sizes = ["validation", "212", "300", "N", "12.30 %"]
    assert rows["other"] == [*sizes, "follows position", "5", "1", "31"]
    assert rows["hold"][-3:] == ["5", "–", "–"]


def test_force_that_does_not_bring_the_run_near_its_noise_is_not_said_to_explain_it() -> None:
    assert force().explains
    assert replace(force(), left=(1.4, 1.3)).explains
    poor = replace(force(), left=(7.38, 7.08))
    assert not poor.explains
    assert force_text([poor]).endswith("follows position, but a run under it still leaves 7.08 times the noise")


def test_newtons_of_a_gauge_are_said_to_be_relative() -> None:
    assert "relative to the assumed area" not in page_of([force()])[1].words
    assert "relative to the assumed area" in page_of([force()], UnknownModel())[1].words


def test_largest_force_is_one_of_validation_data_and_outside_its_band() -> None:
    forces = [force("quiet", zero=True, size=800.0), force("loud"), force("learn", held_out=False, size=900.0)]
    assert largest_force(forces).recording == "loud"
    assert largest_force(forces[2:]).recording == "learn"
    assert "zero" in force_text(forces[:1])


def test_band_encloses_the_force_and_is_drawn_in_the_static_copy() -> None:
    chart = force_chart(force())
    panel = chart.panels[0]
    assert panel.band is not None
    upper, lower = (panel.series[i].drawn for i in panel.band)
    np.testing.assert_allclose(upper - lower, 2.0 * 1.6449 * 10.0, rtol=1e-4)
    axes = static_figure(chart).axes[0]
    assert len(axes.collections) == 1
    assert np.all(panel.series[3].drawn == 0.0)


def test_force_with_a_memory_parts_into_two_curves() -> None:
    plain = force()
    loop = replace(plain, force=plain.force + 100.0 * np.sign(plain.known["velocity"]))
    for given, apart in ((plain, 0.0), (loop, 200.0)):
        chart = against_chart(given, "position")
        assert chart is not None
        out, back = (series.values for series in chart.panels[0].series[:2])
        assert np.nanmedian(out - back) == pytest.approx(apart, abs=5.0)


def test_quantity_that_stands_still_has_no_chart() -> None:
    still = force()
    assert against_chart(replace(still, known={**still.known, "position": np.zeros(len(TIME))}), "position") is None


def test_close_loop_writes_the_force_of_every_recording() -> None:
    done = command("nothing")
    report = json.loads((done.out / "report.json").read_text(encoding="utf-8"))
    told = report["remaining"]["latent_force"]
    assert set(told) == {"learn", "hold"}
    assert told["hold"]["held_out"]
    assert told["hold"]["zero"]
    assert told["hold"]["unit"] == "N"
    assert told["hold"]["rms"] < told["hold"]["peak"]
    assert told["hold"]["share_of_inertia"] < 0.03
    assert "The force that the model lacks is zero within its 90 % band" in done.printed
    page = read_page((done.out / "report.html").read_text(encoding="utf-8"))
    assert "The force that the model lacks" in page.headings


def test_forces_are_a_table_in_python() -> None:
    forces = LatentForces([force(), force("learn", held_out=False, zero=True)])
    assert not forces.zero
    assert forces["learn"].kinds.zero
    assert forces[0].recording == "hold"
    assert re.search(r"hold.*validation.*position", repr(forces))


def test_script_of_the_page_fills_the_band() -> None:
    script = Path(force_section.__code__.co_filename).parent / "web" / "charts.js"
    assert "bands: panel.band" in script.read_text(encoding="utf-8")

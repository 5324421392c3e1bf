"""The demo's parts: measured runs, hidden table, a recorded run over DDS, summary. The whole takes minutes."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from closed_loops import command, recording

from shake_ros import __main__
from shake_ros.api.fitted import with_test
from shake_ros.api.progress import Progress
from shake_ros.demonstration import demo
from shake_ros.demonstration.demo import DemoResult, track_of
from shake_ros.measured import models, runs
from shake_ros.measured.models import MeasuredRuns
from shake_ros.physics.effects import EFFECTS
from shake_ros.quantities import UnknownName
from shake_ros.recordings.bags import TableRecording, read_table_recording, write_table_recording
from shake_ros.settings import find, load_table, read_yaml, save_table

SETTINGS = read_yaml(find("demo", "default"))
TIME = np.arange(3000) * 0.001


@pytest.fixture(scope="module")
def measured() -> MeasuredRuns:
    """The five measured runs with the variant that explains them, from fewer starts than the demo's."""
    content = read_yaml(find("measured", "variants"))
    zone = content["variants"]["soft_zone"]
    few = {"declared": content["declared"], "variants": {"soft_zone": {**zone, "trials": zone["trials"][:1]}}}

    def short(path: Path) -> object:
        return few if path.name == "variants.yaml" else read_yaml(path)

    with (
        mock.patch.object(runs, "read_yaml", short),
        mock.patch.object(models, "STARTS", 3),
        contextlib.redirect_stderr(io.StringIO()),
        Progress("test") as bar,
    ):
        return demo.measured_runs(bar)


def test_soft_zone_explains_the_measured_runs_to_the_printed_figure(measured: MeasuredRuns) -> None:
    assert measured.best.effect == "soft_zone"
    assert measured.best.rms <= 0.11


def test_declared_model_leaves_the_measured_runs_unexplained(measured: MeasuredRuns) -> None:
    assert measured.declared.rms == pytest.approx(0.31, abs=0.03)


def test_fundamentals_of_the_measured_runs_agree_within_four_per_cent(measured: MeasuredRuns) -> None:
    amplitudes, first = measured.amplitudes(measured.best), 0
    for run in measured.problem.runs:
        assert run.orders[0] == 1
        assert amplitudes[first] == pytest.approx(run.harmonics[1], rel=0.04)
        first += len(run.orders)
    assert first == 28


def test_variant_earns_its_parameters_by_the_information_criterion(measured: MeasuredRuns) -> None:
    for fitted in (measured.declared, *measured.variants):
        residuals, p = fitted.fit.residuals, len(fitted.fit.x)
        closed = len(residuals) * np.log(np.mean(residuals**2)) + p * np.log(len(residuals))
        assert fitted.criterion == pytest.approx(closed)
    assert len(measured.best.fit.x) == len(measured.declared.fit.x) + 3
    assert measured.best.criterion < measured.declared.criterion - 10.0


def test_seed_draws_the_same_hidden_table_every_time() -> None:
    assert demo.hide(SETTINGS, 3, None) == demo.hide(SETTINGS, 3, None)


def test_seeds_draw_different_effects_and_tables() -> None:
    drawn = [demo.hide(SETTINGS, seed, None) for seed in range(12)]
    assert len({h.effect for h in drawn}) >= 5
    assert len({h.table.value("bulk_modulus.modulus") for h in drawn}) == 12


@pytest.mark.parametrize("effect", sorted(SETTINGS["hidden"]))
def test_hidden_table_has_one_effect_that_the_declared_table_has_not(effect: str) -> None:
    hidden = demo.hide(SETTINGS, 1, effect)
    assert hidden.effect == effect
    assert effect in EFFECTS
    assert set(hidden.table.effects) == {effect}
    assert load_table(SETTINGS["declared"]).effects == {}
    for name, (low, high) in SETTINGS["spread"].items():
        factor = hidden.table.value(name) / load_table(SETTINGS["declared"]).value(name)
        assert low <= factor <= high


def test_named_effect_does_not_change_the_tables_own_values() -> None:
    chosen, other = (demo.hide(SETTINGS, 4, e).table for e in ("soft_zone", "command_delay"))
    assert dataclasses.replace(chosen, effects={}) == dataclasses.replace(other, effects={})


def test_effect_that_the_demo_cannot_hide_is_refused_before_anything_is_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UnknownName, match="did you mean 'soft_zone'"):
        demo.hide(SETTINGS, 1, "soft_zon")
    assert __main__.main(["demo", "--hidden", "soft_zon", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_negative_seed_is_refused_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert __main__.main(["demo", "--seed", "-1", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == "shake_ros demo: --seed -1: must not be negative\n"


def test_demo_replaces_an_earlier_demo_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(demo, "_run", stop)
    out = tmp_path / "out"
    out.mkdir()
    assert __main__.main(["demo", "--out", str(out)]) == 130
    (out / "thesis.txt").write_text("years of work", encoding="utf-8")
    assert __main__.main(["demo", "--out", str(out)]) == 2
    assert "is not the result of a demo" in capsys.readouterr().err
    (out / "summary.json").write_text("{}", encoding="utf-8")
    assert __main__.main(["demo", "--out", str(out)]) == 130
    assert sorted(p.name for p in out.iterdir()) == ["summary.json", "thesis.txt"]


def test_recorded_runs_have_sensor_noise_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    experiment = pytest.importorskip("shake_ros.ros.graph")
    seeds = []
    monkeypatch.setattr(experiment, "record", lambda _, **how: seeds.append(how["seed"]))
    with contextlib.redirect_stderr(io.StringIO()), Progress("test") as bar:
        for seed in (1, 2):
            for name in ("excitation", "earthquake", "earthquake_again"):
                demo.record_run(tmp_path, name, SETTINGS, demo.hide(SETTINGS, seed, None), "bergamo", bar)
    assert len(set(seeds)) == 6


def test_found_table_is_handed_over_wherever_the_demo_is_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    experiment = pytest.importorskip("shake_ros.ros.graph")
    monkeypatch.setattr(experiment, "record", lambda *_, **__: None)
    monkeypatch.chdir(tmp_path)
    work, found = tmp_path / "work", Path("out/found.yaml")
    work.mkdir()
    found.parent.mkdir()
    save_table(found, load_table("bergamo"), "found")
    hidden = demo.hide(SETTINGS, 1, None)
    with contextlib.redirect_stderr(io.StringIO()), Progress("test") as bar:
        demo.record_run(work, "earthquake_again", SETTINGS, hidden, found, bar)
    for kind in ("observer", "controller"):
        assert read_yaml(work / f"{kind}_earthquake_again.yaml")["model"] == str(tmp_path / found)


def followed(path: Path, share: float) -> TableRecording:
    """A recording whose true motion is `share` short of the reference."""
    wave = np.sin(2.0 * np.pi * TIME)
    reference = np.column_stack([wave, 2.0 * np.pi * np.cos(2.0 * np.pi * TIME), -((2.0 * np.pi) ** 2) * wave])
    write_table_recording(
        path,
        TIME,
        0.1 * wave,
        0.05 * wave,
        0.1 * wave,
        reference=0.05 * reference,
        truth=0.05 * (1 - share) * reference,
    )
    return read_table_recording(path)


def test_tracking_error_of_a_motion_that_falls_short_is_its_share(tmp_path: Path) -> None:
    error = track_of(followed(tmp_path / "run", 0.03)).errors
    assert error == pytest.approx({"position": 0.03, "velocity": 0.03, "acceleration": 0.03}, rel=1e-3)


def test_summary_keeps_the_contract_and_tells_right_from_wrong(measured: MeasuredRuns, tmp_path: Path) -> None:
    shares = zip(demo.MODELS, (0.05, 0.01), strict=True)
    tracks = {name: track_of(followed(tmp_path / name.replace(" ", "_"), share)) for name, share in shares}
    done, third = command("spool_deadband"), [recording("spool_deadband", 3, "third")]
    found = DemoResult(measured, "spool_deadband", with_test(done.result, third), done.learn, done.hold, third, tracks)
    summary = demo.summarise(found, 101.25)
    assert set(summary) == {"harmonics", "hidden", "tracking", "seconds"}
    assert set(summary["harmonics"]) == {"baseline_rms", "effect", "final_rms"}
    assert {"effect", "named", "hold_before", "hold_after", "test_before", "test_after"} <= set(summary["hidden"])
    assert summary["hidden"]["named"] == summary["hidden"]["effect"] == "spool_deadband"
    for role in ("hold", "test"):
        assert summary["hidden"][f"{role}_after"] < 0.1 * summary["hidden"][f"{role}_before"]
    assert summary["tracking"] == pytest.approx({"before": 0.05, "after": 0.01}, rel=1e-3)
    assert summary["seconds"] == pytest.approx(101.2, abs=0.06)
    text = " ".join(demo.demo_page(found, summary).text().split())
    assert "spool_deadband found from the recordings; the hidden effect was spool_deadband" in text
    assert "5.00 % → 1.00 % position error under the earthquake" in text
    assert f" {100 * summary['hidden']['test_before']:.2f} % → " in text


def test_summary_says_that_nothing_was_named(measured: MeasuredRuns, tmp_path: Path) -> None:
    track = track_of(followed(tmp_path / "run", 0.05))
    done, third = command("nothing"), [recording("nothing", 3, "third")]
    result, tracks = with_test(done.result, third), dict.fromkeys(demo.MODELS, track)
    found = DemoResult(measured, "soft_zone", result, done.learn, done.hold, third, tracks)
    summary = demo.summarise(found, 1.0)
    assert summary["hidden"]["named"] is None
    assert "found from the recordings; the hidden effect was soft_zone" in demo.demo_page(found, summary).text()


def test_run_over_dds_leaves_a_recording_that_a_fit_can_read(
    tmp_path: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy")
    monkeypatch.setattr(demo, "DURATION", {"excitation": 1.5, "earthquake": 1.5})
    hidden = demo.hide(SETTINGS, 2, "soft_zone")
    save_table(tmp_path / "hidden_table.yaml", hidden.table, "hidden")
    with contextlib.redirect_stderr(io.StringIO()), Progress("test") as bar:
        bag = demo.record_run(tmp_path, "excitation", SETTINGS, hidden, SETTINGS["declared"], bar)
    recording = read_table_recording(bag)
    assert recording.segments == (slice(0, len(recording)),)
    assert len(recording) == pytest.approx(1500, abs=2)
    assert recording.sample_time == 0.001
    for values in (recording.acceleration, recording.reference, recording.estimate, recording.truth):
        assert values is not None
    assert np.std(recording.position) > 1e-4
    assert track_of(recording).errors["position"] < 0.5


@pytest.mark.second_tier
def test_demo_names_the_hidden_effect_alone_and_tracks_better_with_it(
    tmp_path: Path, ros_domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rclpy")
    monkeypatch.chdir(tmp_path)
    assert __main__.call("demo", ["--out", "demo"]) == 0
    hidden = json.loads((tmp_path / "demo" / "summary.json").read_text(encoding="utf-8"))["hidden"]
    assert (hidden["named"], hidden["alternatives"]) == (hidden["effect"], [])
    assert hidden["test_after"] < 0.5 * hidden["test_before"]

"""reproduce: the claims of the thesis's chapter 6, the pages, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml

from shake_ros import __main__ as shake_ros
from shake_ros.api.progress import Progress
from shake_ros.entry_points import ENTRY_POINTS
from shake_ros.measured.runs import PRINTED, printed_tables
from shake_ros.settings import find, load_table, read_yaml
from shake_ros.thesis import bulk_modulus, controllers, reduced_model, schedule
from shake_ros.thesis.reproduce import EXPERIMENTS, figure_list


def main(arguments: list[str]) -> int:
    return shake_ros.main(["reproduce", *arguments])


def test_the_table_of_table_6_9_holds_the_printed_parameters() -> None:
    printed = printed_tables(load_table("bergamo"))[PRINTED["with_soft_zone"]]
    assert load_table("bergamo_table_6_9").vector() == pytest.approx(printed.vector(), rel=1e-12)


def test_an_experiment_gives_its_page_the_claims_and_their_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["sensitivity", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert {p.name for p in out.iterdir()} == {
        "index.html", "sensitivity.html", "claims.txt", "claims.json", "tables.txt"
    }  # fmt: skip
    assert (out / "tables.txt").read_text().startswith("Spread of the motion")
    claims = json.loads((out / "claims.json").read_text())["claims"]["sensitivity"]
    assert said.splitlines()[1].startswith(f"{len(claims)} claims: ")
    assert [c["holds"] for c in claims] == [False, False, True, True, True, True]  # table 6.8, then table 6.9
    assert (out / "sensitivity.html").read_text().count("<figure class='chart'") == 12
    assert "<a href='sensitivity.html'>" in (out / "index.html").read_text()
    assert "<a href='index.html'>" in (out / "sensitivity.html").read_text()
    assert main(["sensitivity", "--out", str(out)]) == 2
    assert "exists already" in capsys.readouterr().err


def test_every_figure_of_the_chapter_is_drawn_by_an_experiment_or_says_why_not() -> None:
    listed = []
    for numbers, words in figure_list().items():
        first, _, last = numbers.partition(" to ")
        listed += range(int(first[2:]), int((last or first)[2:]) + 1)
        assert words.split(",")[0] in EXPERIMENTS or " " in words
        if words.startswith("by "):
            assert words.split(",")[0].removeprefix("by ") in ENTRY_POINTS
    assert listed == list(range(1, 63))


def test_an_unknown_experiment_is_one_line_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["controler", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "unknown experiment 'controler'" in said
    assert all(name in said for name in EXPERIMENTS)


@pytest.mark.second_tier
def test_every_controller_of_the_thesis_is_compared_in_every_loop(tmp_path: Path) -> None:
    sine = read_yaml(find("reference", "sine_20mm_2hz"))
    sine["duration"] = 1.0
    sine["shaping"]["soft_start"] = sine["shaping"]["soft_stop"] = 0.25
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(sine), encoding="utf-8")
    loops = read_yaml(find("compare", "thesis"))
    loops |= {"references": [str(tmp_path / "short.yaml")], "figure_reference": "short", "rest": 0.2}
    (tmp_path / "loops.yaml").write_text(yaml.safe_dump(loops), encoding="utf-8")
    words: dict[str, object] = {
        "settings": str(tmp_path / "loops.yaml"),
        "other_plant": {"table": "bergamo"},
        "sines": ["short"],
        "tracks_within": 0.1,
        "same_within": 10.0,
        "responses": {"6.43, 6.44": {"law": "feedforward PI", "reference": str(tmp_path / "short.yaml"), "load": 0.0}},
    }
    (tmp_path / "words.yaml").write_text(yaml.safe_dump(words), encoding="utf-8")
    with Progress("test", lambda text, part: None) as tell:
        found = controllers.run(tell, str(tmp_path / "words.yaml"))
    assert len(found.claims) == 12 * (len(controllers.LOOPS) + 1)
    assert found.charts[0].name == "figure_6.43"
    assert [panel.y for panel in found.charts[0].panels] == ["position [mm]", "velocity [mm/s]", "command [-]"]
    same = [c for c in found.claims if "the same with 500 kg" in c.statement]
    assert all(c.holds for c in same)  # an error that may grow tenfold
    position = next(c for c in found.claims if c.statement.startswith("position error least"))
    shares = {law: float(position.found.split(law)[1].split("%")[0]) for law in controllers.LAWS}
    assert position.holds is (min(shares, key=shares.__getitem__) == "super-twisting")


@pytest.mark.second_tier
def test_the_reduced_model_fits_the_full_one_better_than_the_printed_coefficients(tmp_path: Path) -> None:
    asked = read_yaml(find("reproduce", "reduced_model"))
    asked |= {"fitted_to": ["u6"], "seconds": 2.0, "frequencies": [3.0], "shown": {"6.37": asked["shown"]["6.37"]}}
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(asked), encoding="utf-8")
    with Progress("test", lambda text, part: None) as tell:
        found = reduced_model.run(tell, str(tmp_path / "short.yaml"))
    errors = {row[0]: row for row in found.tables[1].rows}["3"]
    printed, fitted = (float(errors[k].split()[0]) for k in (1, 3))
    assert fitted < printed < 30.0
    assert [row[1] for row in found.tables[0].rows] == ["-1.091e+04", "-3.062", "6991", "-0.3291", "-141.3"]


@pytest.mark.second_tier
def test_without_the_soft_zone_the_models_part_at_low_frequency_and_meet_at_high(tmp_path: Path) -> None:
    asked = read_yaml(find("reproduce", "bulk_modulus"))
    asked |= {"seconds": 1.5, "free": ["bulk_modulus.modulus", "friction.coulomb_level"]}
    asked["runs"]["6.34"] |= {"seconds": 2.5, "doubled_at": 1.0}
    (tmp_path / "short.yaml").write_text(yaml.safe_dump(asked), encoding="utf-8")
    with Progress("test", lambda text, part: None) as tell:
        found = bulk_modulus.run(tell, str(tmp_path / "short.yaml"))
    felt = {row[0]: float(row[6].split()[0]) for row in found.tables[0].rows}  # acceleration, in per cent
    assert felt["6.33"] < 0.5 * min(felt["6.29"], felt["6.32"])
    assert [c.holds for c in found.claims].count(None) == 1
    work = {row[0]: float(row[3]) for row in found.tables[2].rows}
    assert abs(work["table 6.8 with the zone"]) == pytest.approx(28.8, abs=0.2)
    assert abs(work["table 6.8 with the zone, exchanged"]) < 0.05
    assert [chart.name for chart in found.charts][:3] == ["figure_6.29", "figure_6.30", "figure_6.31"]
    modulus, zone = (panel.series[0].values for panel in found.charts[2].panels)
    assert modulus[80] < 0.25 * modulus[-1]  # soft at zero load pressure
    assert zone[80] == pytest.approx(1.0 - load_table("bergamo_table_6_9").value("effects.soft_zone.depth"))


@pytest.mark.second_tier
def test_the_neural_schedule_is_compared_with_one_set_and_the_physical_effect(tmp_path: Path) -> None:
    few = read_yaml(find("schedule", "default"))
    few |= {"amplitudes": [0.1, 0.2, 0.4, 0.6], "frequencies": [1.0, 2.0, 4.0, 6.0], "seeds": [1, 2]}
    (tmp_path / "few.yaml").write_text(yaml.safe_dump(few), encoding="utf-8")
    words = {"settings": str(tmp_path / "few.yaml"), "good_within": 0.2}
    (tmp_path / "words.yaml").write_text(yaml.safe_dump(words), encoding="utf-8")
    with Progress("test", lambda text, part: None) as tell:
        found = schedule.run(tell, str(tmp_path / "words.yaml"))
    assert len(found.claims) == 4
    assert found.claims[3].holds  # soft_zone, which the table has, leaves the least of both recordings
    assert "soft_zone" in found.claims[3].found
    assert [len(table.rows) for table in found.tables] == [2 * 3, 4 * 3]
    errors = {tuple(row[:2]): float(row[3].rstrip(" %")) for row in found.tables[1].rows}
    tracked = [errors[name, "schedule"] <= 20.0 for name in ("amplitude doubled", "sum of sines")]
    assert found.claims[0].holds == all(tracked)
    assert [chart.name.partition("_")[0] for chart in found.charts] == ["training", "error", "error"]

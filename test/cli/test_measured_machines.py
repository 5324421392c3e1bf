"""Machines that others measured: the facts known of their recordings come out of the commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pages import read_page

import shake_ros as sr
from shake_ros.__main__ import main
from shake_ros.declared import effect_candidates, free_parameters
from shake_ros.fit.axis_model import AXIS, force_error, position_errors, with_slow_changes
from shake_ros.fit.free_parameters import FreeParameters
from shake_ros.fit.least_squares import fit
from shake_ros.fit.recording_problem import RecordingProblem
from shake_ros.fit.records import Record
from shake_ros.fit.reduced_model import REDUCED
from shake_ros.physics.plant.parameters import TableParameters
from shake_ros.physics.plant.reduced_simulation import run


@pytest.fixture(scope="module")
def data(shared: Path) -> Path:
    folder = shared / "data"
    if not folder.is_dir():
        pytest.skip("needs the folder data of ../shared, which is not here")
    return folder


def imported(data: Path, file: str, out: Path, *columns: str) -> Path:
    assert main(["import_csv", str(data / file), *columns, "--out", str(out)]) == 0
    return out


@pytest.fixture(scope="module")
def emps(data: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("emps")
    columns = ("--time", "t", "--command", "vir*0.1", "--position", "qm", "--force", "vir*35.15065188")
    return [imported(data, f"emps/{name}.mat", folder / name, *columns) for name in ("DATA_EMPS", "DATA_EMPS_PULSES")]


def test_inverse_dynamics_recovers_the_published_parameters_of_emps(emps: list[Path], tmp_path: Path) -> None:
    arguments = ["--model", "axis", "--method", "inverse_dynamics", "--learn", str(emps[0]), "--hold", str(emps[1])]
    assert main(["identify", *arguments, "--out", str(tmp_path / "out")]) == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    published = {"axis.mass": 95.11, "axis.viscous": 203.5, "axis.coulomb": 20.39, "axis.offset": -3.16}
    for name, value in published.items():
        assert report["parameters"][name]["value"] == pytest.approx(value, rel=0.01)
    assert report["position_error"]["DATA_EMPS_PULSES"] < 0.010  # [m] free run of 25 s


@pytest.fixture(scope="module")
def emps_records(emps: list[Path]) -> list[Record]:
    first, second = (sr.read(bag).records("force") for bag in emps)
    learned, held = with_slow_changes(first, second)
    return [*learned, *held]


def test_the_two_files_of_emps_follow_one_reference_with_friction_of_two_levels(emps_records: list[Record]) -> None:
    first, second = emps_records
    assert float(np.sqrt(np.mean((first.position - second.position) ** 2))) < 0.1e-3
    steady = slice(100, 330)  # before the first pulse: nothing else tells the two apart
    ways = [r.position[steady.stop] - r.position[steady.start] for r in (first, second)]
    forces = [float(np.mean(r.commands[steady])) for r in (first, second)]
    assert ways[1] == pytest.approx(ways[0], rel=2e-3)
    assert forces[1] > 1.02 * forces[0]


def fitted_axis(learned: Record) -> TableParameters:
    """An axis whose viscous friction differs by direction, fitted to one recording."""
    pool = {c.effect: c for c in effect_candidates(AXIS)}
    free = FreeParameters(AXIS.first_table([learned]), [*free_parameters(AXIS), *pool["friction_asymmetry"].free])
    start = free.x_of({"effects.friction_asymmetry.asymmetry": -0.2, "axis.offset": 4.0})
    return free.table(fit(RecordingProblem([learned], AXIS), free, start, evaluations=40).x)


def test_an_axis_learned_from_either_file_of_emps_tells_the_same_of_the_other(emps_records: list[Record]) -> None:
    levels, drifts = [], []
    for learned, held in (emps_records, emps_records[::-1]):
        (learnt,), (judged,) = with_slow_changes([learned], [held])
        table = fitted_axis(learnt)
        assert table.value("effects.friction_asymmetry.asymmetry") == pytest.approx(-0.2, abs=0.03)
        assert position_errors(table, [learnt, judged])[judged.name] < 1.2e-3
        levels.append(AXIS.slow_change(table, judged).level)
        drifts.append({r.name: AXIS.slow_change(table, r).drift for r in (learnt, judged)})
    assert levels[0] == pytest.approx(1.028, abs=4e-3)
    assert levels[0] * levels[1] == pytest.approx(1.0, abs=4e-3)
    for name in drifts[0]:
        assert drifts[0][name] == pytest.approx(drifts[1][name], abs=4e-3)


def test_the_force_of_emps_contradicts_friction_in_steps_at_the_velocities_of_its_reference(
    emps_records: list[Record],
) -> None:
    """Nodes that a fit to the velocity alone has found: free runs err by less than 0.5 mm, also held out."""
    steps = [-27.0, -4.2, -41.4, -3.3, -26.7, -12.9, 5.5, -16.2, -2.1, -9.3, -2.3, 5.4, -10.9, 20.2, -15.5, 5.9]
    nodes = {f"effects.unlisted.node_{i:02d}": value for i, value in enumerate(steps)}
    function = {"effects.unlisted.kind": 3, "effects.unlisted.low": -0.12778, "effects.unlisted.high": 0.12779}
    axis = {"axis.mass": 93.087, "axis.viscous": 101.55, "axis.coulomb": 20.691, "axis.offset": 5.440}
    declared = AXIS.first_table(emps_records[:1])
    stepped = declared.with_values({**axis, **function, **nodes})
    assert max(position_errors(stepped, emps_records).values()) < 1e-3
    assert force_error(stepped, emps_records[:1]) > 1.4 * force_error(declared, emps_records[:1])
    assert AXIS.contradicted(declared, stepped, emps_records[:1])


@pytest.mark.parametrize("current", ["0A", "1A"])
def test_the_closed_loop_of_the_actuator_has_its_known_gain_and_delay(data: Path, tmp_path: Path, current: str) -> None:
    columns = ("--rate", "1000", "--command", "CHANNEL2*0.01", "--position", "CHANNEL0*0.01")
    bag = imported(data, f"mts_actuator/chirp_{current}.txt", tmp_path / "bag", *columns)
    at = ["--at", "0.5", "5", "10", "15", "20"]
    assert main(["frequency_response", str(bag), *at, "--out", str(tmp_path / "out")]) == 0
    rows = json.loads((tmp_path / "out" / "report.json").read_text())["at"]
    for row, gain, delay in zip(rows, (0.99, 0.83, 0.59, 0.43, 0.34), (34.0, 24.0, 19.5, 16.4, 14.0), strict=True):
        assert row["gain"] == pytest.approx(gain, abs=0.012)
        assert 1e3 * row["delay_s"] == pytest.approx(delay, rel=0.04)
        assert row["coherence"] >= 0.995
    assert read_page((tmp_path / "out" / "report.html").read_text(encoding="utf-8")).charts


@pytest.fixture(scope="module")
def electric(data: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("electric")
    columns = ("--time", "t_s", "--command", "ut", "--position", "position")
    names = ("SineA02F02", "SineA05F03", "SineA3F08", "seisme")
    return {name: imported(data, f"electric_table/{name}.csv", folder / name, *columns) for name in names}


@pytest.fixture(scope="module")
def electric_fits(electric: dict[str, Path]) -> tuple[TableParameters, TableParameters, dict[str, float]]:
    """The electric table declared linear, with direction-dependent dry friction, and the held-out errors of both."""
    learn = sr.read(*(electric[name] for name in ("SineA02F02", "SineA05F03", "SineA3F08"))).records()
    hold = RecordingProblem(sr.read(electric["seisme"]).records(), REDUCED)
    problem = RecordingProblem(learn, REDUCED)
    declared = FreeParameters(REDUCED.first_table(learn), free_parameters(REDUCED))
    before = fit(problem, declared, declared.start())
    pool = {c.effect: c for c in effect_candidates(REDUCED)}
    more = [*pool["coulomb_friction"].free, *pool["friction_asymmetry"].free]
    extended = FreeParameters(declared.table(before.x), [*free_parameters(REDUCED), *more])
    start = extended.x_of({"effects.coulomb_friction.force": 50.0})
    after = fit(problem, extended, start, evaluations=60)
    tables = declared.table(before.x), extended.table(after.x)
    errors = [hold.errors(table.vector())["seisme"]["velocity"] for table in tables]
    assert isinstance(tables[0], TableParameters)
    assert isinstance(tables[1], TableParameters)
    return tables[0], tables[1], dict(zip(("before", "after"), errors, strict=True))


def steady(table: TableParameters, command: float) -> float:
    return float(run(table, np.full(600, command), 0.005)[-1, 1])


def test_dry_friction_that_differs_by_direction_halves_the_error_of_the_electric_table(
    electric_fits: tuple[TableParameters, TableParameters, dict[str, float]],
) -> None:
    assert electric_fits[2]["after"] < 0.65 * electric_fits[2]["before"]


def test_the_fit_knows_what_is_known_of_the_electric_table(
    electric: dict[str, Path], electric_fits: tuple[TableParameters, TableParameters, dict[str, float]]
) -> None:
    table = electric_fits[1]
    assert steady(table, 0.35) == pytest.approx(9.1, rel=0.1)
    assert steady(table, -0.35) == pytest.approx(-11.6, rel=0.25)
    assert steady(table, 0.13) == 0.0  # dead below about 0.15 on the positive side …
    assert steady(table, 0.19) > 0.0
    assert steady(table, -0.13) < -1.0  # … and not on the other
    record, *_ = sr.read(electric["SineA3F08"]).records()
    velocity = run(table, record.commands, record.sample_time)[:, 1]
    late = [float(np.dot(record.commands[:-40], velocity[k : len(velocity) - 40 + k])) for k in range(40)]
    assert 45.0 <= 5.0 * int(np.argmax(late)) <= 55.0  # milliseconds from command to velocity
    sine = 0.2 * np.sin(2.0 * np.pi * 0.2 * np.arange(4000) * 0.005)
    assert run(table, sine, 0.005)[-1, 0] == pytest.approx(-29.0, rel=0.15)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--model", "reduced", "--set", "piston_area=1"], "unknown parameter 'piston_area'"),
        (["--model", "reduced", "--config", "nothing"], "unknown table 'nothing'"),
        (["--model", "axis"], "no topic force"),
        (["--model", "full", "--method", "inverse_dynamics"], "needs --model axis"),
    ],
)
def test_wrong_arguments_end_with_one_clear_line(
    electric: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], text: str
) -> None:
    bag = str(electric["SineA02F02"])
    capsys.readouterr()
    assert main(["identify", *arguments, "--learn", bag, "--out", str(tmp_path / "out")]) == 2
    assert text in capsys.readouterr().err.splitlines()[-1]
    assert not (tmp_path / "out").exists()

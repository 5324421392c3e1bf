"""Programs: rest at both ends, three signals that belong together, changes while running."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from shake_ros.control.reference import REFERENCES
from shake_ros.control.reference.program import Program, Shaping, crossfade, keeps_phase
from shake_ros.control.reference.waves import SineParameters, StepParameters
from shake_ros.quantities import ShakeError, describe
from shake_ros.recordings.reference_file import build_program, load_reference, make_program
from shake_ros.settings import config_folder

CONFIGURED = sorted(path.stem for path in (config_folder() / "reference").glob("*.yaml"))
PLAIN = Shaping(soft_start=1.0, soft_stop=1.0, change_time=0.5, filter_frequency=0.0, filter_damping=0.7)
BARE = PLAIN.replace(soft_start=0.0, soft_stop=0.0)
SINE = SineParameters(amplitude=0.02, frequency=2.0, duration=6.0)


def defects(program: Program) -> tuple[float, float]:
    """Largest difference between an increment and Simpson's integral of its derivative, relative to the peaks.

    Simpson over two samples is exact to h⁵, so what is left is rounding unless a signal is not the other's derivative.
    """
    h = program.sample_time
    states = program.states

    def simpson(signal: np.ndarray) -> np.ndarray:
        return h / 3.0 * (signal[:-2] + 4.0 * signal[1:-1] + signal[2:])

    found = []
    for order in (0, 1):
        derivative = states[:, order + 1]
        gap = states[2:, order] - states[:-2, order] - simpson(derivative)
        found.append(float(np.max(np.abs(gap))) / (h * max(float(np.max(np.abs(derivative))), 1e-30)))
    return found[0], found[1]


def test_every_kind_has_a_configuration() -> None:
    assert set(REFERENCES) == {load_reference(name).kind for name in CONFIGURED}


@pytest.mark.parametrize("kind", sorted(REFERENCES))
def test_every_parameter_has_a_unit_and_a_meaning(kind: str) -> None:
    for metadata in describe(REFERENCES[kind]).values():
        assert metadata["meaning"]
        assert "unit" in metadata


@pytest.mark.parametrize("name", CONFIGURED)
def test_velocity_is_the_derivative_of_position_and_acceleration_that_of_velocity(name: str) -> None:
    position, velocity = defects(build_program(name, 0.001))
    assert position < 1e-4
    # a bare step makes the filter's acceleration jump once; elsewhere acceleration is continuous
    assert velocity < (2.0 if name == "step" else 2e-2)


@pytest.mark.parametrize("name", CONFIGURED)
def test_defects_vanish_with_the_sample_time(name: str) -> None:
    coarse, fine = defects(build_program(name, 0.002)), defects(build_program(name, 0.0005))
    assert fine[0] <= max(0.5 * coarse[0], 1e-9)


@pytest.mark.parametrize("name", CONFIGURED)
def test_program_starts_and_ends_at_rest_and_stays_inside_the_table(name: str) -> None:
    program = build_program(name, 0.001)
    assert np.max(np.abs(program.states[:, 0])) <= 0.051
    assert np.max(np.abs(program.states[:, 1])) <= 0.32
    assert program.at(0)[:2] == (0.0, pytest.approx(0.0, abs=1e-12))
    assert program.at(program.length - 1)[1:] == (0.0, 0.0)
    assert abs(program.states[-2, 1]) < 1e-4


@pytest.mark.parametrize("name", CONFIGURED)
def test_program_is_the_same_every_time(name: str) -> None:
    assert np.array_equal(build_program(name, 0.001).states, build_program(name, 0.001).states)


def test_after_its_end_the_last_position_is_held_without_velocity() -> None:
    parameters = StepParameters(amplitude=0.03, delay=0.1, rise_time=0.5, duration=1.0)
    program = Program("step", parameters, BARE, 0.001)
    assert program.length == 1001
    for k in (1000, 1001, 10**9):
        assert program.at(k) == (pytest.approx(0.03), 0.0, 0.0)
    assert program.at(-1) == (0.0, 0.0, 0.0)


def test_samples_are_what_at_gives() -> None:
    program = Program("sine", SINE, PLAIN, 0.01)
    rows = program.samples(-3, program.length + 10)
    assert np.array_equal(rows, [program.at(k) for k in range(-3, program.length + 7)])


def test_sine_in_the_middle_is_the_closed_form() -> None:
    program = Program("sine", SINE, PLAIN, 0.001)
    omega = 4.0 * np.pi
    for k in (1500, 2345, 4000):
        t = k * 0.001
        expected = (0.02 * np.sin(omega * t), 0.02 * omega * np.cos(omega * t), -0.02 * omega**2 * np.sin(omega * t))
        assert program.at(k) == pytest.approx(expected, abs=1e-12)


def test_states_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        Program("sine", SINE, PLAIN, 0.001).states[0, 0] = 1.0


def test_a_start_with_velocity_is_refused_with_the_remedy() -> None:
    with pytest.raises(ShakeError, match=r"starts with 0\.251 m/s: give soft_start > 0"):
        Program("sine", SINE, PLAIN.replace(soft_start=0.0), 0.001)
    with pytest.raises(ShakeError, match=r"ends with .* give soft_stop > 0"):
        Program("sine", SINE, PLAIN.replace(soft_stop=0.0), 0.001)


def test_a_bare_step_is_refused_without_the_filter() -> None:
    parameters = StepParameters(amplitude=0.03, delay=0.1, rise_time=0.0, duration=4.0)
    with pytest.raises(ShakeError, match=r"jumps by 0\.03 m"):
        Program("step", parameters, BARE, 0.001)
    with pytest.raises(ShakeError, match=r"jumps by 0\.03 m"):
        Program("step", parameters, PLAIN.replace(soft_start=0.0), 0.001)


def test_soft_start_and_stop_longer_than_the_program_are_refused() -> None:
    with pytest.raises(ShakeError, match=r"exceed its length 6 s"):
        Program("sine", SINE, PLAIN.replace(soft_start=4.0, soft_stop=3.0), 0.001)


def test_unknown_kind_lists_the_known_ones() -> None:
    with pytest.raises(ShakeError, match=r"did you mean 'sine'.*earthquake"):
        Program("sinus", SINE, PLAIN, 0.001)


def test_parameters_of_another_kind_are_refused() -> None:
    with pytest.raises(ShakeError, match="takes StepParameters"):
        Program("step", SINE, PLAIN, 0.001)


@pytest.mark.parametrize("restart", [False, True])
def test_a_change_while_running_keeps_the_three_signals_consistent(restart: bool) -> None:
    old = Program("sine", SINE, PLAIN, 0.001)
    new = Program("sine", SINE.replace(amplitude=0.04, frequency=2.0 if not restart else 3.0), PLAIN, 0.001)
    changed = crossfade(old, new, 2500, 0.5, restart)
    assert np.array_equal(changed.states[:2501], old.states[:2501])
    offset = 2500 if restart else 0
    assert np.allclose(changed.states[3000:], new.states[3000 - offset :], atol=1e-15)
    assert changed.length == new.length + offset
    assert max(defects(changed)) < 1e-4


def test_a_change_after_the_end_of_the_old_program_starts_the_new_one_from_rest() -> None:
    old = Program("step", StepParameters(amplitude=0.03, delay=0.0, rise_time=0.5, duration=1.0), BARE, 0.001)
    new = Program("sine", SINE, PLAIN, 0.001)
    changed = crossfade(old, new, 3000, 1.0, restart=True)
    assert changed.at(2999) == (pytest.approx(0.03), 0.0, 0.0)
    assert changed.at(changed.length)[0] == pytest.approx(0.0)
    assert max(defects(changed)) < 2e-3  # the jerk of the ramps has kinks


def test_only_a_change_of_size_keeps_the_phase() -> None:
    assert keeps_phase(SINE, SINE.replace(amplitude=0.01))
    assert not keeps_phase(SINE, SINE.replace(frequency=1.0))
    assert not keeps_phase(SINE, StepParameters(amplitude=0.03, delay=0.0, rise_time=0.5, duration=1.0))


def test_a_change_during_a_change_stays_consistent() -> None:
    programs = [Program("sine", SINE.replace(amplitude=a), PLAIN, 0.001) for a in (0.01, 0.03, 0.02)]
    twice = crossfade(crossfade(programs[0], programs[1], 2000, 1.0), programs[2], 2400, 1.0)
    assert max(defects(twice)) < 1e-4
    assert np.allclose(twice.states[3400:], programs[2].states[3400:])


def test_a_change_between_sample_times_is_refused() -> None:
    with pytest.raises(ShakeError, match="sample times"):
        crossfade(Program("sine", SINE, PLAIN, 0.001), Program("sine", SINE, PLAIN, 0.002), 0, 1.0)


def test_summary_reports_peaks_and_crest_factor() -> None:
    summary = Program("sine", SINE.replace(duration=60.0), PLAIN, 0.001).summary()
    assert summary["peak_position"] == pytest.approx(0.02, rel=1e-3)
    assert summary["crest_factor_velocity"] == pytest.approx(np.sqrt(2.0), rel=0.02)
    assert summary["duration"] == pytest.approx(60.0)


def test_configuration_errors_name_the_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    for content, message in (
        ("amplitude: 1\n", "missing key 'kind'"),
        ("kind: sine\n", "missing key 'shaping'"),
        ("kind: sinus\nshaping: {}\n", "did you mean 'sine'"),
        ("kind: none\nduration: 1\nshaping: {}\n", "shaping: missing soft_start"),
        ("kind: none\nduration: -1\nshaping: {}\n", "duration = -1 is outside"),
    ):
        path.write_text(content)
        with pytest.raises(ShakeError, match=message) as error:
            load_reference(str(path))
        assert str(path) in str(error.value)


def test_a_record_that_is_absent_is_one_line() -> None:
    reference = load_reference("earthquake")
    changed = reference._replace(parameters=reference.parameters.replace(record="no/such.AT2"))
    with pytest.raises(ShakeError, match=r"^no/such\.AT2: cannot be read \(No such file or directory\)$"):
        make_program(changed, 0.001)

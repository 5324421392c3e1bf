"""Response spectra against closed forms, an independent integration and a matrix exponential."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import cont2discrete, lfilter, ss2tf

from shake_ros.control.reference.baseline import integrate
from shake_ros.control.reference.motion import smooth_step
from shake_ros.quantities import ShakeError
from shake_ros.signals.response_spectrum import response_spectrum

STEP = 0.001
FREQUENCIES = np.array([0.5, 1.0, 2.0, 10.0])


def noise(highest: float, seed: int = 1) -> np.ndarray:
    """8 s of noise up to a frequency [Hz], at rest at both ends."""
    n = 8000
    f = np.fft.rfftfreq(n, STEP)
    phases = np.random.RandomState(seed).uniform(0.0, 2.0 * np.pi, f.size)
    t = np.arange(n) * STEP
    found = np.fft.irfft(np.where(f < highest, np.exp(1j * phases), 0.0), n) * np.sin(np.pi * t / t[-1]) ** 2
    return np.asarray(found / np.max(np.abs(found)))


def system(f: float, damping: float) -> tuple[np.ndarray, ...]:
    """From the acceleration of the ground to relative displacement and absolute acceleration: A, B, C, D."""
    w = 2.0 * np.pi * f
    rows = np.array([[1.0, 0.0], [-w * w, -2.0 * damping * w]])
    return np.array([[0.0, 1.0], rows[1]]), np.array([[0.0], [-1.0]]), rows, np.zeros((2, 1))


def by_matrix_exponential(a: np.ndarray, step: float, f: float, damping: float) -> tuple[float, float]:
    """Largest |relative displacement| and |absolute acceleration|, sampled at 200 points of a period or more."""
    finer = int(np.ceil(200.0 * f * step))
    h, w = step / finer, 2.0 * np.pi * f
    lines = np.interp(np.arange((a.size - 1) * finer + 1) / finer, np.arange(a.size), a)
    fall = lines[-1] * np.linspace(1.0, 0.0, finer + 1)[1:]
    load = np.concatenate([lines, fall, np.zeros(int(1.5 / f / h))])
    m = np.zeros((4, 4))
    m[0, 1], m[1, 0], m[1, 1], m[1, 2], m[2, 3] = h, -w * w * h, -2.0 * damping * w * h, -h, 1.0
    ((e00, e01, e02, e03), (e10, e11, e12, e13)) = expm(m)[:2].tolist()
    x, v, largest, swing = 0.0, 0.0, 0.0, 0.0
    for p, q in itertools.pairwise(load.tolist()):
        x, v = (
            e00 * x + e01 * v + (e02 - e03) * p + e03 * q,
            e10 * x + e11 * v + (e12 - e13) * p + e13 * q,
        )
        largest, swing = max(largest, abs(x)), max(swing, abs(w * w * x + 2.0 * damping * w * v))
    return largest, swing


SHAPES = {
    "half sine": lambda n: np.sin(np.pi * np.arange(n) / (n - 1)),
    "rectangular": np.ones,
    "one sample": lambda n: np.eye(1, n)[0],
    "walk": lambda n: np.cumsum(np.random.RandomState(2).standard_normal(n)),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("duration", "rate"), [(0.05, 2000.0), (1.0, 200.0), (20.0, 50.0)])
@pytest.mark.parametrize("damping", [0.0, 0.05, 0.5])
def test_pulses_and_their_free_vibration_are_those_of_a_matrix_exponential(
    shape: str, duration: float, rate: float, damping: float
) -> None:
    a = SHAPES[shape](round(duration * rate) + 1)
    frequencies = np.array([0.4, 2.0, 8.0])
    found = response_spectrum(a, 1.0 / rate, frequencies, damping)
    exact = np.array([by_matrix_exponential(a, 1.0 / rate, f, damping) for f in frequencies])
    np.testing.assert_allclose(found.displacement, exact[:, 0], rtol=0.002)
    np.testing.assert_allclose(np.abs(found.acceleration), exact[:, 1], rtol=0.002)


def test_short_pulse_leaves_the_spectrum_of_its_impulse() -> None:
    """A slow undamped oscillator: ω ∫a dt, reached a quarter of a period behind the pulse; nothing from the start."""
    a = np.where(np.arange(1501) <= 550, 0.33, 0.0)
    found = response_spectrum(a, 2e-5, np.array([0.5]), 0.0)
    assert abs(found.acceleration[0]) == pytest.approx(2.0 * np.pi * 0.5 * 0.33 * 0.01101, rel=1e-3)
    assert found.time[0] == pytest.approx(0.5 + 0.0055, abs=1e-3)


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.3])
def test_constant_acceleration_gives_the_overshoot_of_the_closed_form(damping: float) -> None:
    omega = 2.0 * np.pi * FREQUENCIES
    expected = 2.0 / omega**2 * (1.0 + np.exp(-np.pi * damping / np.sqrt(1.0 - damping**2)))
    lasting = np.append(np.full(601, 2.0), 2.0 * smooth_step(np.linspace(1.0, 0.0, 2000))[0])  # it ends without a swing
    assert np.allclose(response_spectrum(lasting, 0.01, FREQUENCIES, damping).displacement, expected, rtol=0.001)


@pytest.mark.parametrize("damping", [0.005, 0.02, 0.05, 0.20])
@pytest.mark.parametrize("band_limited", [False, True])
def test_a_sine_is_amplified_as_the_closed_form_says(damping: float, band_limited: bool) -> None:
    n, f0 = 120_000, 8.0
    t = np.arange(n) * STEP
    sine = np.sin(2.0 * np.pi * f0 * t) * smooth_step(t / 40.0)[0] * smooth_step((t[-1] - t) / 40.0)[0]
    f = np.array([8.0, 20.0, 200.0])
    r = f0 / f
    exact = np.sqrt((1.0 + (2.0 * damping * r) ** 2) / ((1.0 - r**2) ** 2 + (2.0 * damping * r) ** 2))
    found = np.abs(response_spectrum(sine, STEP, f, damping, band_limited).acceleration)
    np.testing.assert_allclose(found, exact, rtol=1e-3)


def test_stiff_oscillator_follows_the_ground_and_a_soft_one_stays_behind() -> None:
    time = np.arange(2001) * 0.01
    acceleration = np.sin(2.0 * np.pi * time) * np.sin(np.pi * time / 20.0) ** 2
    found = response_spectrum(acceleration, 0.01, np.array([200.0, 0.002]), 0.05)
    assert abs(found.acceleration[0]) == pytest.approx(np.max(np.abs(acceleration)), rel=0.01)
    _, ground = integrate(acceleration, 0.01)
    assert found.displacement[1] == pytest.approx(np.max(np.abs(ground)), rel=0.01)


def test_noise_agrees_with_an_independent_integration() -> None:
    acceleration = np.append(np.random.RandomState(1).standard_normal(100), 0.0)
    time = np.arange(101) * 0.05
    omega, damping = 2.0 * np.pi / 0.4, 0.05
    solution = solve_ivp(
        lambda t, s: (s[1], -np.interp(t, time, acceleration) - 2.0 * damping * omega * s[1] - omega**2 * s[0]),
        (0.0, 6.0),
        (0.0, 0.0),
        t_eval=np.arange(6001) * 0.001,
        rtol=1e-9,
        atol=1e-12,
        max_step=0.01,
    )
    found = response_spectrum(acceleration, 0.05, np.array([2.5]), damping)
    total = np.abs(2.0 * damping * omega * solution.y[1] + omega**2 * solution.y[0])
    assert found.displacement[0] == pytest.approx(np.max(np.abs(solution.y[0])), rel=0.001)
    assert abs(found.acceleration[0]) == pytest.approx(np.max(total), rel=0.001)


def test_record_at_100_khz_has_the_spectrum_of_the_same_motion_at_1_khz() -> None:
    def motion(step: float) -> np.ndarray:
        t = np.arange(round(20.0 / step) + 1) * step
        return np.asarray(np.sin(np.pi * t / 20.0) ** 2 * np.sin(2.0 * np.pi * (0.1 * t + 0.05 * t**2)))

    f = np.geomspace(0.05, 10.0, 12)
    fast, slow = response_spectrum(motion(1e-5), 1e-5, f, 0.05), response_spectrum(motion(1e-3), 1e-3, f, 0.05)
    np.testing.assert_allclose(fast.displacement, slow.displacement, rtol=1e-3)
    np.testing.assert_allclose(fast.acceleration, slow.acceleration, rtol=1e-3)


@pytest.mark.parametrize("damping", [0.02, 0.10])
def test_band_limited_spectrum_is_that_of_a_finely_sampled_record(damping: float) -> None:
    a, fine = noise(60.0), 16
    n = a.size
    spectrum = np.fft.rfft(a)
    dense = np.fft.irfft(np.pad(spectrum, (0, n * fine // 2 + 1 - spectrum.size)), n * fine) * fine
    frequencies = np.array([1.0, 7.0, 40.0, 100.0])
    found = response_spectrum(a, STEP, frequencies, damping, band_limited=True)
    for k, f in enumerate(frequencies):
        numerators, denominator = ss2tf(*cont2discrete(system(f, damping), STEP / fine, "foh")[:4])
        relative, absolute = (np.max(np.abs(lfilter(b, denominator, dense))) for b in numerators)
        assert found.displacement[k] == pytest.approx(relative, rel=1e-3)
        assert abs(found.acceleration[k]) == pytest.approx(absolute, rel=1e-3)


def test_at_four_tenths_of_the_sampling_rate_a_band_limited_record_stays_within_two_percent() -> None:
    n, f0 = 8000, 400.0
    t = np.arange(n) * STEP
    window = np.sin(np.pi * t / t[-1]) ** 2
    sine = np.sin(2.0 * np.pi * f0 * t + 0.3) * window
    found = response_spectrum(sine, STEP, np.array([f0]), 0.05, band_limited=True)
    assert abs(found.acceleration[0]) == pytest.approx(np.sqrt(1.0 + 4.0 * 0.05**2) / (2.0 * 0.05), rel=0.02)
    assert found.time[0] == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize(
    ("record", "frequencies", "damping", "band_limited", "message"),
    [
        (np.ones(10), np.array([0.0]), 0.05, False, "above 0 Hz"),
        (np.ones(10), np.array([]), 0.05, False, "above 0 Hz"),
        (np.ones(10), FREQUENCIES, 1.0, False, "damping = 1 is outside"),
        (np.ones(10), np.array([500.0]), 0.05, True, "asked for 500 Hz"),
        (np.ones(1), FREQUENCIES, 0.05, False, "1 samples at 0.001 s"),
        (np.array([0.0, np.nan, 0.0]), FREQUENCIES, 0.05, False, "1 of them not finite"),
    ],
)
def test_what_is_no_record_or_no_oscillator_is_refused(
    record: np.ndarray, frequencies: np.ndarray, damping: float, band_limited: bool, message: str
) -> None:
    with pytest.raises(ShakeError, match=message):
        response_spectrum(record, STEP, frequencies, damping, band_limited)

"""Response spectra against others, and their speed: python -m benchmarks.qualification.spectra [--save].

Pulses and records: half sines, rectangular pulses and noise of 0.05 to 20 s, linear between samples, that end with the
recording; 25 frequencies from 0.1 to 50 Hz, four dampings. Beside them the exact transition by scipy's matrix
exponential, at 200 points of a period or more, with the free vibration behind the record: largest difference of
absolute acceleration and of relative displacement.

Band-limited: 20 s of noise to 150 Hz under an envelope, sampled at 1 kHz; absolute acceleration at 81 frequencies from
0.1 to 100 Hz. The others get the same band-limited record 16 times as finely sampled: scipy's discrete transition by
the matrix exponential (always), pyyeti's shock response spectrum and eqsig's Nigam and Jennings (where they are
installed: pip install pyyeti eqsig; they are no dependencies). Last, a record with content to 450 Hz at 400 Hz, that is
0.4 of the sampling rate, with the correction (resampling through the Fourier transform and 1/sinc²) and with
straight lines between the samples.

Speed: 60 s at 1 kHz, 300 frequencies from 0.1 to 100 Hz, dampings 2, 5 and 10 %, the least of five, by the clock and
of all cores.
--save writes benchmarks/qualification/spectra.txt.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from shake_ros.signals.response_spectrum import response_spectrum

Array = NDArray[np.float64]
STEP, FINE = 0.001, 16
POINTS = 200.0  # of the matrix exponential in a period, at least: a peak between two is missed by 0.012 %
DAMPINGS = (0.005, 0.02, 0.05, 0.20)
FREQUENCIES = np.geomspace(0.1, 100.0, 81)


def record(seconds: float, highest: float, seed: int = 3) -> Array:
    """Noise from 0.1 Hz to `highest`, at rest at both ends, 3 m/s² at most."""
    n = round(seconds / STEP)
    f = np.fft.rfftfreq(n, STEP)
    phases = np.random.RandomState(seed).uniform(0.0, 2.0 * np.pi, f.size)
    noise = np.fft.irfft(np.where((f > 0.1) & (f < highest), np.exp(1j * phases), 0.0), n)
    noise *= np.sin(np.pi * np.arange(n) / (n - 1)) ** 2
    return np.asarray(3.0 * noise / np.max(np.abs(noise)))


def finely(a: Array, factor: int) -> Array:
    """The band-limited record at `factor` times its rate."""
    spectrum = np.fft.rfft(a)
    return (
        np.asarray(np.fft.irfft(np.pad(spectrum, (0, a.size * factor // 2 + 1 - spectrum.size)), a.size * factor))
        * factor
    )


def by_matrix_exponential(a: Array, step: float, frequencies: Array, damping: float) -> tuple[Array, Array]:
    """Largest |relative displacement| and |absolute acceleration|, of samples of a record that is linear between them.

    From the exact transition of [x, ẋ, a, ȧ] over a step, in its two modes; 1.5 periods of rest follow the record.
    """
    found = np.empty((2, frequencies.size))
    for k, w in enumerate(2.0 * np.pi * frequencies):
        finer = math.ceil(POINTS * w * step / (2.0 * np.pi))
        h, n = step / finer, a.size
        rest = math.ceil(3.0 * np.pi / w / h)
        lines = np.interp(np.arange((n - 1) * finer + 1) / finer, np.arange(n), a)
        load = np.concatenate([lines, lines[-1] * np.linspace(1.0, 0.0, finer + 1)[1:], np.zeros(rest)])
        system = np.zeros((4, 4))
        system[0, 1] = system[2, 3] = 1.0
        system[1, :3] = -w * w, -2.0 * damping * w, -1.0
        m = expm(system * h)
        rates, modes = np.linalg.eig(m[:2, :2])
        now, then = np.linalg.solve(modes, np.column_stack([m[:2, 3] / h, m[:2, 2] - m[:2, 3] / h])).T
        first = [-now[i] * load[0] for i in range(2)]  # at rest at the first sample
        states = [lfilter([now[i], then[i]], [1.0, -rates[i]], load, zi=[first[i]])[0] for i in range(2)]
        x, v = (modes @ np.array(states)).real
        found[:, k] = np.max(np.abs(x)), np.max(np.abs(w * w * x + 2.0 * damping * w * v))
    return found[0], found[1]


def pulses() -> list[str]:
    """A line a shape and duration: the largest differences over frequencies and dampings."""
    rng, f = np.random.RandomState(5), np.geomspace(0.1, 50.0, 25)
    lines = [f"{'record':12s} {'duration':>9s} {'rate':>9s}  largest difference: acceleration, displacement"]
    for duration, rate in ((0.05, 5000.0), (0.2, 1000.0), (1.0, 500.0), (5.0, 200.0), (20.0, 200.0), (0.5, 1e5)):
        n = round(duration * rate) + 1
        shapes = {
            "half sine": np.sin(np.pi * np.arange(n) / (n - 1)),
            "rectangular": np.ones(n),
            "noise": np.cumsum(rng.standard_normal(n)),
        }
        for name, a in shapes.items():
            off = np.zeros(2)
            for damping in (0.0, *DAMPINGS[1:]):
                ours = response_spectrum(a, 1.0 / rate, f, damping)
                exact = by_matrix_exponential(a, 1.0 / rate, f, damping)
                pairs = (np.abs(ours.acceleration), exact[1]), (ours.displacement, exact[0])
                off = np.maximum(off, [np.max(np.abs(found / right - 1.0)) for found, right in pairs])
            lines.append(f"{name:12s} {duration:7g} s {rate:6.0f} Hz  {100.0 * off[0]:.4f} %, {100.0 * off[1]:.4f} %")
    return lines


def others() -> dict[str, Callable[[Array, float, Array, float], Array]]:
    """The implementations that are there, by name."""
    found: dict[str, Callable[[Array, float, Array, float], Array]] = {
        "matrix exponential": lambda *given: by_matrix_exponential(*given)[1]
    }
    with suppress(ImportError):
        from pyyeti.srs import srs

        def of_pyyeti(a: Array, step: float, frequencies: Array, damping: float) -> Array:
            given = {"ic": "zero", "stype": "absacce", "rolloff": "none", "parallel": "no"}
            return np.asarray(srs(a, 1.0 / step, frequencies, 0.5 / damping, **given)).ravel()

        found["pyyeti"] = of_pyyeti
    with suppress(ImportError):
        from eqsig.sdof import true_response_spectra

        def of_eqsig(a: Array, step: float, frequencies: Array, damping: float) -> Array:
            return np.asarray(true_response_spectra(a, step, 1.0 / frequencies, damping)[2])

        found["eqsig"] = of_eqsig
    return found


def accuracy() -> list[str]:
    """A line a damping and another implementation, and those at 0.4 of the sampling rate."""
    a = record(20.0, 150.0)
    dense = np.append(finely(a, FINE), np.zeros(round(1.5 * FINE / (STEP * FREQUENCIES[0]))))  # for the free vibration
    lines = [f"{'damping':>8s}  {'against':20s} largest difference, 0.1 … 100 Hz at 1 kHz"]
    for damping in DAMPINGS:
        ours = np.abs(response_spectrum(a, STEP, FREQUENCIES, damping, band_limited=True).acceleration)
        for name, of in others().items():
            off = np.abs(of(dense, STEP / FINE, FREQUENCIES, damping) / ours - 1.0)
            worst = int(np.argmax(off))
            lines.append(f"{damping:8.3f}  {name:20s} {100.0 * off[worst]:.4f} % at {FREQUENCIES[worst]:.3g} Hz")
    a, f = record(20.0, 450.0), np.array([400.0])
    dense = finely(a, 4 * FINE)
    for damping in DAMPINGS:
        exact = by_matrix_exponential(dense, STEP / (4 * FINE), f, damping)[1][0]
        ours = abs(response_spectrum(a, STEP, f, damping, band_limited=True).acceleration[0])
        plain = abs(response_spectrum(a, STEP, f, damping).acceleration[0])
        text = f"0.4 of the rate: {100.0 * (ours / exact - 1.0):+.3f} %, without the correction"
        lines.append(f"{damping:8.3f}  {'matrix exponential':20s} {text} {100.0 * (plain / exact - 1.0):+.1f} %")
    return lines


def speed() -> str:
    """The least of five, for all three dampings."""
    a, f = record(60.0, 150.0), np.geomspace(0.1, 100.0, 300)
    least = spent = np.inf
    for _ in range(5):
        began, busy = time.perf_counter(), time.process_time()
        for damping in (0.02, 0.05, 0.10):
            response_spectrum(a, STEP, f, damping, band_limited=True)
        least, spent = min(least, time.perf_counter() - began), min(spent, time.process_time() - busy)
    return f"60 s at 1 kHz, 300 frequencies, 3 dampings: {least:.3f} s, {spent:.3f} s of processor time"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--save", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore", DeprecationWarning)
    lines = [*pulses(), "", *accuracy(), speed()]
    print("\n".join(lines))
    if given.save:
        Path(__file__).with_suffix(".txt").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

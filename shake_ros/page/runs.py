"""Runs: from the first motion of the reference to its rest; how well each was tracked, and its response spectrum."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from shake_ros.core.analysis.response_spectrum import response_spectrum
from shake_ros.page.samples import SampleStore

Floats = npt.NDArray[np.float64]
REST = 1e-5  # a slower reference is at rest [m/s]
PAUSE = 0.6  # a run ends when it has been at rest for so long [s]
SHORTEST = 0.5  # [s]
LONGEST = 120.0  # of a run, the rest is not looked at [s]
KEPT = 12
PERIODS = 60
BANDS = 220  # points of a spectrum


class RunMeter:
    """Looks at what is settled; `runs` holds the latest runs, the newest last."""

    def __init__(self, store: SampleStore) -> None:
        self._store = store
        self._seen = (store.epoch, 0)
        self._moving = 0.0  # how long the present run lasts, rests included [s]
        self._rest = 0.0
        self.runs: list[dict[str, Any]] = []

    def look(self, words: Mapping[str, str]) -> None:
        """After each `settle`; `words` say what runs: reference, controller, observer, table."""
        store = self._store
        epoch, seen = self._seen
        if epoch != store.epoch:
            self._moving = self._rest = 0.0
            seen = 0
        fresh = (store.settled - seen) * store.sample_time
        self._seen = store.epoch, store.settled
        if fresh <= 0.0:
            return
        moves = np.abs(store.newest("reference_velocity", fresh)) > REST
        if moves.any():
            self._moving += fresh
            self._rest = 0.0
        elif self._moving:
            self._moving += fresh
            self._rest += fresh
            if self._rest >= PAUSE:
                if self._moving - self._rest > SHORTEST:
                    self._take(min(self._moving, LONGEST), words)
                self._moving = self._rest = 0.0

    def _take(self, seconds: float, words: Mapping[str, str]) -> None:
        store = self._store
        names = ("tracking_error", "reference_position", "acceleration", "reference_acceleration")
        error, wanted, felt, asked = (store.newest(name, seconds) for name in names)
        if np.isfinite(error).any():
            row = dict(words, ended=time.time(), seconds=seconds - self._rest)
            threading.Thread(target=self._judge, args=(row, error, wanted, felt, asked), daemon=True).start()

    def _judge(self, row: dict[str, Any], error: Floats, wanted: Floats, felt: Floats, asked: Floats) -> None:
        """Not in the thread that takes samples: a spectrum takes a while, and compiles at first."""
        from shake_ros.core.loop.metrics import (
            DAMPING,
            HIGHEST,
            LOWEST,  # slow to import
        )

        known = np.isfinite(error)
        rms = float(np.sqrt(np.mean(error[known] ** 2)))
        size = float(np.sqrt(np.nanmean((wanted - np.nanmean(wanted)) ** 2)))
        periods = np.geomspace(1.0 / HIGHEST, 1.0 / LOWEST, PERIODS)
        step = self._store.sample_time
        spectra = [
            np.abs(response_spectrum(np.nan_to_num(a), step, 1.0 / periods, DAMPING).acceleration)
            for a in (felt, asked)
        ]
        run = {
            **row, "error_rms": rms, "error_peak": float(np.abs(error[known]).max()),
            "error_relative": rms / size if size > 0.0 else None,
            "periods": _short(periods), "spectrum": _short(spectra[0]), "wanted": _short(spectra[1]),
        }  # fmt: skip
        self.runs = [*self.runs[-KEPT + 1 :], run]


def _short(values: Floats) -> list[float]:
    return [float(f"{value:.4g}") for value in values]


@lru_cache(maxsize=4)
def _flat_top(n: int) -> Floats:
    turn = 2.0 * np.pi * np.arange(n) / n
    weights = (0.21557895, -0.41663158, 0.277263158, -0.083578947, 0.006947368)
    return np.sum([a * np.cos(k * turn) for k, a in enumerate(weights)], axis=0)


def amplitude_spectrum(values: Floats, sample_time: float) -> tuple[Floats, Floats]:
    """Frequencies [Hz] and amplitudes of a segment, the largest of each band on a logarithmic axis; missing is zero.

    A flat-top window, so that the amplitude of a line is its own wherever it falls between two bins.
    """
    n = len(values)
    if n < 256:
        return np.zeros(0), np.zeros(0)
    window = _flat_top(n)
    amplitude = np.abs(np.fft.rfft(np.nan_to_num(values) * window)) * 2.0 / np.sum(window)
    frequency = np.asarray(np.fft.rfftfreq(n, sample_time), dtype=np.float64)
    edges = np.unique(np.searchsorted(frequency, np.geomspace(4.0 / (n * sample_time), frequency[-1], BANDS)))
    edges = edges[edges < len(frequency)]
    highest: Floats = np.maximum.reduceat(amplitude, edges)
    return frequency[edges], highest

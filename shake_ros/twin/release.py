"""Followed values on their way to observer, feedforward and gains, once the operator releases them.

A value is handed on only while no test says that the table is unsound, within a factor of the one in the table's file,
and slowly: the values in the loop approach their targets as exp(−t/τ). A target stays where it is until the followed
value is three standard deviations away, so that what scatters moves nothing. Taken back, the values go the same way to
those of the file.

A gain that is a command per motion is divided by the velocity that a command now gives over that of the file, so that
the feedback around the table stays as it was designed; β change as the closed form of the table does
(physics/plant/reduced.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from shake_ros.physics.plant.parameters import DELAY, FULL_LAYOUT, TableParameters
from shake_ros.physics.plant.reduced import closed_form
from shake_ros.quantities import Parameters
from shake_ros.twin.twin import Twin, TwinWindow

CLEAR = 3.0  # standard deviations from its target, from which a followed value moves it
CLOSE = 1e-4  # of its unit, within which a value has arrived
BETAS = ("beta1", "beta2", "beta3", "beta4", "beta5")
COMMAND_PER = ("1/m", "1/(m s)", "s/m", "s^2/m", "1/Pa")  # units of a gain that makes a command of a motion or pressure
SLOPE = "_slope"  # ends the name of a number in such a unit that is no gain


class Release:
    """What the loop has of the followed values.

    The dead time is left as it is: observer and controller agree on an instant.

    Parameters
    ----------
    twin : with the table of its file. factor : by which a value may leave that of the file. time : τ [s].

    Attributes
    ----------
    names : dotted names of the values that are handed on. file, given, target : in the table's file, in the loop, and
        wanted there, each of shape (p,).
    """

    def __init__(self, twin: Twin, factor: float, time: float) -> None:
        of_table = [i for i, n in enumerate(twin.names) if n in FULL_LAYOUT.fields and n != DELAY]
        self._time, self._places = time, np.array(of_table, dtype=int)
        self.names = tuple(twin.names[i] for i in of_table)
        self.file = np.array([twin.file.value(n) for n in self.names])
        self._unit = twin.scale[self._places]
        least, most = (np.array([FULL_LAYOUT.fields[n].metadata[k] for n in self.names]) for k in ("low", "high"))
        room = (factor - 1.0) * self._unit
        low = np.where(self._unit == self.file, self.file / factor, self.file - room)
        self._low, self._high = np.maximum(low, least), np.minimum(self.file + room, most)
        self.given, self.target = self.file.copy(), self.file.copy()

    def know(self, window: TwinWindow) -> tuple[str, ...]:
        """Take what a window of a sound table shows; the names whose targets moved."""
        values, deviations = window.values[self._places], window.deviations[self._places]
        wanted = np.clip(values, self._low, self._high)
        moved = (np.abs(values - self.target) > CLEAR * deviations) & (wanted != self.target)
        self.target = np.where(moved, wanted, self.target)
        return tuple(n for n, m in zip(self.names, moved, strict=True) if m)

    def step(self, seconds: float, on: bool) -> bool:
        """Bring the values nearer to their targets, or where `on` is false to the file; whether any has moved.

        Parameters
        ----------
        seconds : since the step before, in which the table was sound.
        """
        goal = self.target if on else self.file
        gap = goal - self.given
        there = np.abs(gap) <= CLOSE * self._unit
        self.given = np.where(there, goal, self.given - gap * np.expm1(-seconds / self._time))
        return bool(np.any(gap))

    @property
    def changes(self) -> dict[str, float]:
        """Values in the loop that are not those of the file, by dotted name."""
        rows = zip(self.names, self.given.tolist(), self.file.tolist(), strict=True)
        return {n: value for n, value, file in rows if value != file}

    def text(self, names: tuple[str, ...]) -> str:
        """Targets of some values in words, and which of them are at their bound."""
        words = []
        for n in names:
            i = self.names.index(n)
            at, file = float(self.target[i]), float(self.file[i])
            bound = " (its bound)" if at in (self._low[i], self._high[i]) else ""
            words.append(f"{n} {f'× {at / file:.3f}' if self._unit[i] == file else f'{file:.4g} → {at:.4g}'}{bound}")
        return ", ".join(words)


def for_table(parameters: Parameters, file: TableParameters, now: TableParameters) -> dict[str, float]:
    """Numbers of an observer or a controller that were made for a table, as they are for the table now.

    Parameters
    ----------
    parameters : made for `file`. file, now : of the full model.

    Returns
    -------
    Field → value, of those fields that depend on the table.
    """
    before, after = closed_form(file).beta, closed_form(now).beta
    ratio: Mapping[str, float] = {n: getattr(after, n) / getattr(before, n) for n in BETAS if getattr(before, n)}
    gain = ratio["beta3"] / ratio["beta1"]  # of the velocity that a command gives
    found = dict[str, float]()
    for f in fields(parameters):
        value: Any = getattr(parameters, f.name)
        if f.name in ratio:
            found[f.name] = value * ratio[f.name]
        elif f.name == "jerk_per_command":
            found[f.name] = value * ratio["beta3"]
        elif f.metadata.get("unit") in COMMAND_PER and not f.name.endswith(SLOPE):
            found[f.name] = value / gain
    return found

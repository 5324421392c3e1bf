"""Faults of what goes between two nodes: of the numbers of a sample, and of its way.

Everything is told by stamps; nothing here reads a clock, and the same samples with the same seed come out the same.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from shake_ros.core.quantities import Parameters, quantity

SECOND = 1_000_000_000
Sample = tuple[int, tuple[float, ...]]  # stamp [ns], numbers


@dataclass(frozen=True)
class MessageFaultParameters(Parameters):
    """Faults of one topic: none, until one is set. Bias, noise, jump and NaN hit the first number, in its own unit."""

    delay: float = quantity("s", "a sample leaves so much later", low=0.0, high=10.0, live=True, default=0.0)
    drop: float = quantity("-", "share of the samples that are lost", low=0.0, high=1.0, live=True, default=0.0)
    duplicate: float = quantity("-", "share that comes twice", low=0.0, high=1.0, live=True, default=0.0)
    reorder: float = quantity("-", "share that changes places with the next", low=0.0, high=1.0, live=True, default=0.0)
    freeze: bool = quantity("", "the numbers stay as they are, under new stamps", live=True, default=False)
    jump: float = quantity("SI", "one sample is off by this, once when it is set", live=True, default=0.0)
    bias: float = quantity("SI", "every sample is off by this", live=True, default=0.0)
    noise: float = quantity("SI", "standard deviation of noise", low=0.0, live=True, default=0.0)
    nan: float = quantity("-", "share of the samples that are not a number", low=0.0, high=1.0, live=True, default=0.0)

    def on(self) -> dict[str, float]:
        """The faults that are on, with their values.

        >>> MessageFaultParameters(delay=0.01, freeze=True).on()
        {'delay': 0.01, 'freeze': 1.0}
        """
        return {name: float(value) for name, value in vars(self).items() if value}


class MessageFaults:
    """The samples of one topic in, what is left of them out.

    Parameters
    ----------
    seed : of what is left to chance.

    >>> faults = MessageFaults(1)
    >>> faults.apply(MessageFaultParameters(delay=0.002))
    >>> [faults.carry(k * 1_000_000, (float(k),)) for k in range(4)]
    [[], [], [(0, (0.0,))], [(1000000, (1.0,))]]
    """

    def __init__(self, seed: int) -> None:
        self.parameters = MessageFaultParameters()
        self._random = np.random.default_rng(seed)
        self._frozen: tuple[float, ...] | None = None
        self._jump = 0.0
        self._swapped: Sample | None = None
        self._line: deque[Sample] = deque()

    def apply(self, parameters: MessageFaultParameters) -> None:
        """Take other faults, between two samples; a jump happens where it is set anew."""
        if parameters.jump != self.parameters.jump:
            self._jump = parameters.jump
        self.parameters = parameters

    def carry(self, stamp: int, values: tuple[float, ...]) -> list[Sample]:
        """What leaves when the sample of a stamp [ns] comes, in the order in which it leaves."""
        leaving = [(stamp, self._numbers(values))]
        leaving = self._swap(self._double(self._lose(leaving)))
        self._line.extend(leaving)
        due = stamp - round(self.parameters.delay * SECOND)
        found = []
        while self._line and self._line[0][0] <= due:
            found.append(self._line.popleft())
        return found

    def _happens(self, share: float) -> bool:
        """Whether chance hits this sample."""
        return share > 0.0 and float(self._random.random()) < share

    def _numbers(self, values: tuple[float, ...]) -> tuple[float, ...]:
        p = self.parameters
        if p.freeze:
            if self._frozen is None:
                self._frozen = values
            values = self._frozen
        else:
            self._frozen = None
        first = values[0] + p.bias + self._jump
        self._jump = 0.0
        if p.noise > 0.0:
            first += p.noise * float(self._random.standard_normal())
        return (math.nan if self._happens(p.nan) else first, *values[1:])

    def _lose(self, leaving: list[Sample]) -> list[Sample]:
        return [] if self._happens(self.parameters.drop) else leaving

    def _double(self, leaving: list[Sample]) -> list[Sample]:
        return 2 * leaving if self._happens(self.parameters.duplicate) else leaving

    def _swap(self, leaving: list[Sample]) -> list[Sample]:
        """A sample that was kept back leaves behind this one; or this one is kept back."""
        if self._swapped is not None:
            kept, self._swapped = self._swapped, None
            return [*leaving, kept]
        if leaving and self._happens(self.parameters.reorder):
            self._swapped = leaving[0]
            return leaving[1:]
        return leaving

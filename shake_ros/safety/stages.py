"""The stages of the hydraulics: up one by one, each confirmed and for its time; down from a hold, through low pressure.

Times are in [ns]; nothing here reads a clock.
"""

from __future__ import annotations

OFF, LOW, HIGH, RUN = range(4)
STAGES = ("off", "low pressure", "high pressure", "run")


class Stages:
    """The stage that the hydraulics are asked for.

    Attributes
    ----------
    stage : OFF … RUN.
    times : for which OFF, LOW and HIGH last at least [ns].
    """

    def __init__(self) -> None:
        self.stage = OFF
        self.times = (0.0, 0.0, 0.0)
        self._since = -1

    def advance(self, now: int, wanted: int, confirmed: int, *, moving: bool) -> None:
        """Towards `wanted`, as far as the hydraulics have confirmed; RUN is not left while the command acts.

        >>> stages = Stages()
        >>> stages.times = 0.0, 2e9, 1e9
        >>> for now in range(0, 4_000_000_000, 1_000_000_000):
        ...     stages.advance(now, RUN, confirmed=RUN, moving=False)
        ...     print(STAGES[stages.stage])
        low pressure
        low pressure
        high pressure
        run
        """
        while self.stage < wanted and confirmed >= self.stage:
            if self._since < 0 or self.stage == OFF:
                self._since = now
            if now - self._since < self.times[self.stage]:
                return
            self.stage += 1
            self._since = now
        while self.stage > wanted:
            if self.stage == RUN and moving:
                return
            if self.stage == LOW and now - self._since < self.times[LOW]:
                return
            self.stage -= 1
            self._since = now

"""What stands between a command and the valve: enable, stop and reset, stale commands, two commanders.

Thin and without ROS: stamps in, valve command out. The state of the hold is text for /diagnostics.
"""

from __future__ import annotations

from shake_ros.ros.diagnostics import ERROR, OK, WARN


class Interlock:
    """Decides which command acts.

    Parameters
    ----------
    enabled : whether commands act from the start.
    stale_after : a command older than this [ns] takes the table to a safe hold.
    ramp_time : from full command to zero in a safe hold [ns].
    """

    def __init__(self, enabled: bool, stale_after: int, ramp_time: int) -> None:
        self.enabled = enabled
        self.stopped = False
        self.fault = ""
        self.holds = 0
        self._stale_after = stale_after
        self._ramp_time = ramp_time
        self._command = 0.0
        self._stamp = -1
        self._acting = 0.0
        self._last = -1
        self._holding = False

    def command(self, stamp: int, u: float) -> None:
        """A new command u in [−1, 1] for the instant `stamp` [ns]; larger ones are clipped."""
        self._stamp = stamp
        self._command = min(max(u, -1.0), 1.0)

    def reset(self) -> None:
        """Forget stop and fault."""
        self.stopped = False
        self.fault = ""

    def act(self, now: int) -> float:
        """The command that acts from `now` [ns] on."""
        elapsed = now - self._last if self._last >= 0 else 0
        self._last = now
        if self.stopped or not self.enabled or self._stamp < 0:
            self._acting = 0.0
            return 0.0
        stale = now - self._stamp > self._stale_after
        if not (stale or self.fault):
            self._holding = False
            self._acting = self._command
            return self._acting
        if not self._holding:
            self._holding = True
            self.holds += 1
        step = elapsed / self._ramp_time if self._ramp_time > 0 else 1.0
        self._acting = max(0.0, self._acting - step) if self._acting > 0.0 else min(0.0, self._acting + step)
        return self._acting

    def condition(self) -> tuple[int, str]:
        """Level and text of the present state."""
        if self.fault:
            return ERROR, f"safe hold: {self.fault}"
        if self.stopped:
            return WARN, "stopped; waiting for reset"
        if not self.enabled:
            return WARN, "not enabled"
        if self._stamp < 0:
            return WARN, "waiting for the first command"
        if self._holding:
            age = (self._last - self._stamp) * 1e-9
            return ERROR, f"safe hold: no command for {age:.3f} s"
        return OK, "running"

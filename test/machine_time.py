"""What must keep real time is judged on a machine that does: a failure beside a bare timer that ran late is void."""

from __future__ import annotations

import functools
import json
import subprocess
import sys
from collections.abc import Callable
from typing import ParamSpec

import pytest

from benchmarks import ROOT

PROGRAM = ROOT / "benchmarks" / "realtime" / "bare_timer.py"
ATTEMPTS = 3
LONGEST = 10.0  # the machine keeps time while no tick of the timer is later [ms] …
MISSED = 0.01  # … and no more of its periods are missed
P = ParamSpec("P")


class BareTimer:
    """A process beside the block that does nothing but tick at 1 kHz; `lateness` then says what it did not keep."""

    def __init__(self) -> None:
        command = [sys.executable, "-I", "-S", str(PROGRAM)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.lateness = ""

    def __enter__(self) -> BareTimer:
        return self

    def __exit__(self, *_: object) -> None:
        ticked = json.loads(self._process.communicate(timeout=30.0)[0])
        periods, longest = ticked["ticks"] + ticked["missed"], ticked["max"] / 1000.0
        if longest > LONGEST or ticked["missed"] > MISSED * periods:
            self.lateness = (
                f"a bare timer beside it ran at {1000.0 * ticked['ticks'] / periods:.0f} Hz of 1000 Hz, "
                f"its longest pause {longest:.0f} ms"
            )


def on_a_machine_that_keeps_time(test: Callable[P, None]) -> Callable[P, None]:
    """The decorated test may fail only while a bare timer keeps time beside it.

    A failure while the machine did not keep time is void, and the test is made again; after ATTEMPTS void ones it is
    skipped, with the timer's rate as the reason. No other worker's test runs beside it.
    """

    @pytest.mark.alone
    @functools.wraps(test)
    def judged(*arguments: P.args, **named: P.kwargs) -> None:
        reasons = []
        for _ in range(ATTEMPTS):
            timer = BareTimer()
            try:
                with timer:
                    return test(*arguments, **named)
            except Exception:
                if not timer.lateness:
                    raise
                reasons.append(timer.lateness)
        pytest.skip(f"the machine kept no time in {ATTEMPTS} attempts: {'; '.join(reasons)}")

    return judged

"""The nodes in the usual rclpy way, as a yardstick: SingleThreadedExecutor, rclpy timers, message objects.

    python -m benchmarks.realtime.usual_pattern NAME --ros-args …

The same physics and topics as `python -m shake_ros NAME`; only the executor, the clock and the conversions differ.
"""

from __future__ import annotations

import sys
import time
from typing import Any

from rclpy.executors import SingleThreadedExecutor

from shake_ros.__main__ import main
from shake_ros.ros import conversions, loop
from shake_ros.ros.conversions import SECOND


def run_ticks(self: loop.NodeLoop, ticking: list[Any]) -> None:
    """Ticks from rclpy timers; a period without a tick counts as missed."""
    first = time.time_ns()
    for behaviour in ticking:
        period, last = behaviour.frame.period, [0]

        def tick(behaviour: Any = behaviour, period: int = period, last: list[int] = last) -> None:
            count = (time.time_ns() - first) // period
            if count <= last[0]:
                return
            behaviour.frame.diagnostics.missed += count - last[0] - 1
            behaviour.tick(first + count * period, count - last[0])
            last[0] = count

        behaviour.frame.node.create_timer(period / SECOND, tick)


def use() -> None:
    """Put the usual pattern in place of ours, in this process."""
    loop.make_executor = lambda context: SingleThreadedExecutor(context=context)
    loop.NodeLoop._run_ticks = run_ticks  # type: ignore[method-assign]  # the usual one
    conversions.Codec._agrees_with_middleware = lambda self: False  # type: ignore[method-assign]  # the usual one


if __name__ == "__main__":
    use()
    sys.exit(main())

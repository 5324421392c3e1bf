"""How nodes run and end: the executor and loop patterns that measured best, in one file.

* Events: nodes that answer to messages. `EventsExecutor` with finite timeouts (its `spin()` without one delivers
  nothing in the published wheels), stopped from inside a callback, since its timeout does not expire under
  saturated traffic.
* Ticks: nodes that keep real time. An own loop over absolute deadlines of the monotonic clock, in the thread of
  the executor; the executor attends to services every `ATTEND`-th tick, or in every pause where other nodes
  share the process. A tick that comes later than a period is not made up for: the node gets the number of skipped ones.
* Before the first node starts: what `shake_ros/realtime.py` asks for where `realtime.enabled`, with one warning on what
  is refused; and the garbage collector is held. It works after each report, never within a step.

`main` runs one node as a process; `Loop` runs any number in one thread.

Where the nodes have finished, the process ends whatever the middleware does with it. Fast DDS 3.2 may never come back
from the destruction of a participant while peers leave as well: `set_listener` waits, again and again and with the
interpreter's lock, for a discovery callback that waits for the lock of `set_listener`. Of graphs of seven nodes that
end together on a busy machine, one in a hundred had such a node. No Python code runs any more then, not even a
signal's handler, so a timer of the C library ends the process.
"""

from __future__ import annotations

import ctypes
import functools
import gc
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.qos_overriding_options import InvalidQosOverridesError
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import remove_ros_args

from shake_ros import realtime
from shake_ros.quantities import ShakeError
from shake_ros.ros.diagnostics import OK, WARN
from shake_ros.ros.frame import DELIVERY, Behaviour, Frame
from shake_ros.ros.parameters import read_parameter_files
from shake_ros.settings import config_folder

CLOCK_MONOTONIC = 1
SIGEV_THREAD = 2


class _Event(ctypes.Structure):
    """`struct sigevent` of Linux: call `function(value)` in a thread of its own."""

    _fields_ = [
        ("value", ctypes.c_void_p), ("signal", ctypes.c_int), ("notify", ctypes.c_int),
        ("function", ctypes.c_void_p), ("attributes", ctypes.c_void_p), ("rest", ctypes.c_byte * 32),
    ]  # fmt: skip


class _Times(ctypes.Structure):
    """`struct itimerspec`: interval and first expiry."""

    _fields_ = [(name, ctypes.c_long) for name in ("again", "again_ns", "seconds", "nanoseconds")]


def _library() -> ctypes.CDLL | None:
    """The one with timers: libc, before glibc 2.34 librt; none elsewhere."""
    for name in (None, "librt.so.1"):
        try:
            found = ctypes.CDLL(name)
            found.timer_create  # noqa: B018  (is it there?)
        except (OSError, AttributeError):
            continue
        return found
    return None


@contextmanager
def ends_within(seconds: float, code: int = 0) -> Iterator[None]:
    """End this process with an exit code, there and then, where the block takes longer [s]."""
    library = _library()
    if library is None:
        yield
        return
    leave = ctypes.cast(ctypes.CDLL(None)._exit, ctypes.c_void_p)
    event = _Event(value=code, notify=SIGEV_THREAD, function=leave.value)
    timer = ctypes.c_void_p()
    if library.timer_create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)):
        yield
        return
    whole = int(seconds)
    times = _Times(seconds=whole, nanoseconds=int((seconds - whole) * 1e9))
    library.timer_settime(timer, 0, ctypes.byref(times), None)
    try:
        yield
    finally:
        library.timer_delete(timer)


TIMEOUT = 0.1  # an idle executor looks for a stop this often [s]
STARTING = 0.01  # pause between two looks for the awaited readers [s]
ATTEND = 10  # ticks between two looks at services, where the node has the process for itself
MARGIN = 150_000  # the executor gives back the thread so long before a deadline [ns]
REPORT_PERIOD = 1.0  # of /diagnostics [s]
SIGNAL_REPEAT = 2.0  # after a signal, the next one means that the node hangs [s]
SLOW_START = 2.0  # from then on a start says that it compiles [s]
TAKEN_DOWN = 3.0  # from then on the middleware is not waited for [s], but that lock-step readers have their time first
PR_SET_TIMERSLACK = 29
DISCOVERY_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
LOCAL = ("LOCALHOST", "OFF")

Build = Callable[[Frame], Behaviour]


def make_executor(context: Context) -> Executor:
    """The events executor where rclpy has one, else the single-threaded one."""
    try:
        from rclpy.experimental.events_executor import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor(context=context)
    return EventsExecutor(context=context)


def ask_for_real_time(behaviours: Sequence[Behaviour]) -> None:
    """What the nodes of this process ask of the system, the first that asks for all; one warning on refusal."""
    held = all(one.frame.realtime.freeze_collector for one in behaviours)
    (realtime.hold_collector if held else gc.enable)()
    asking = [one.frame for one in behaviours if one.frame.realtime.enabled]
    if asking:
        refused = realtime.ask_for(asking[0].realtime)
        if refused:
            asking[0].node.get_logger().warning(f"{refused}; see docs/howto/realtime.md")
    granted = realtime.in_force()
    for one in behaviours:
        one.frame.diagnostics.values["realtime"] = lambda: granted


def sleep_until(deadline: int) -> None:
    """Sleep until `deadline` [ns] of the monotonic clock."""
    left = deadline - time.monotonic_ns()
    if left > 0:
        time.sleep(left * 1e-9)


class NodeLoop:
    """Runs nodes in the calling thread until one of them stops it."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.executor = make_executor(context)
        self.behaviours: list[Behaviour] = []
        self.stopping = False
        self.running = False
        self._done: Future[None] = Future()

    def add(self, behaviour: Behaviour) -> None:
        """Take in a node that has been built."""
        frame = behaviour.frame
        frame.stop_loop = self.stop
        report = functools.partial(self._report, frame)
        frame.every(REPORT_PERIOD, report if frame.lockstep else lambda: frame.pause.put_off(report))
        self.behaviours.append(behaviour)
        self.executor.add_node(frame.node)

    def _report(self, frame: Frame) -> None:
        frame.diagnostics.publish()
        if frame is self.behaviours[0].frame:
            realtime.collect()

    def stop(self) -> None:
        """End `run` soon; safe in callbacks and signal handlers."""
        self.stopping = True
        if not self._done.done():
            self._done.set_result(None)

    def spin(self, timeout: float) -> None:
        """Serve callbacks for at most `timeout` [s], or until `stop`."""
        self.executor.spin_until_future_complete(self._done, timeout_sec=timeout)

    def attend(self, timeout: float) -> None:
        """Serve callbacks between two ticks, for at most `timeout` [s]; at least one where one waits.

        One callback a call: `spin_until_future_complete` of the published wheels keeps 32 bytes of every call, 2 MiB a
        minute at 1 kHz.
        """
        end = time.monotonic() + timeout
        while self._alive():
            self.executor.spin_once(timeout_sec=max(0.0, end - time.monotonic()))
            if time.monotonic() >= end:
                return

    def _alive(self) -> bool:
        return not self.stopping and self.context.ok()

    def run(self) -> None:
        """Start every node once its awaited readers are there, then serve them until `stop`."""
        self.running = True
        ask_for_real_time(self.behaviours)
        waiting = list(self.behaviours)
        ticking: list[Behaviour] = []
        while waiting and self._alive():
            for behaviour in [one for one in waiting if one.frame.ready()]:
                waiting.remove(behaviour)
                if os.environ.get(DISCOVERY_RANGE) not in LOCAL:
                    behaviour.frame.exclusive.elsewhere(behaviour.frame.node, lambda: self.spin(STARTING))
                behaviour.frame.diagnostics.publish()
                behaviour.start()
                behaviour.frame.say(OK, "running")
                if behaviour.ticks and behaviour.frame.simulated:
                    behaviour.frame.follow_clock(behaviour.tick)
                elif behaviour.ticks:
                    ticking.append(behaviour)
            if waiting:
                self.spin(STARTING)
        if ticking:
            self._run_ticks(ticking)
        while self._alive():
            self.spin(TIMEOUT)

    def _run_ticks(self, ticking: list[Behaviour]) -> None:
        """Absolute deadlines; the stamps lie on the same grid of the wall clock."""
        ctypes.CDLL(None).prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
        period = ticking[0].frame.period
        attend = ATTEND if len(self.behaviours) == 1 else 1
        first_stamp = time.time_ns() + period
        first_deadline = time.monotonic_ns() + period
        count, last = 0, -1
        while self._alive():
            deadline = first_deadline + count * period
            if count % attend == 0:
                pause = deadline - time.monotonic_ns() - MARGIN
                self.attend(max(0, pause) * 1e-9)
            sleep_until(deadline)
            late = time.monotonic_ns() - deadline
            skipped = max(0, late // period)
            count += skipped
            for behaviour in ticking:
                diagnostics = behaviour.frame.diagnostics
                diagnostics.missed += skipped
                diagnostics.lateness(late)
                behaviour.tick(first_stamp + count * period, count - last)
            last = count
            count += 1

    def close(self, timeout: float = math.inf) -> None:
        """Let every node finish, then take it down; the process ends where that takes longer than `timeout` [s]."""
        self.running = True  # a signal no longer ends the process at once
        failed = int(sys.exc_info()[0] is not None)
        with ExitStack() as watched:
            for behaviour in self.behaviours:
                try:
                    behaviour.finish()
                    if not behaviour.frame.lockstep:
                        for line in behaviour.frame.diagnostics.whole_run.lines():
                            behaviour.frame.node.get_logger().info(line)
                finally:
                    if behaviour is self.behaviours[-1] and math.isfinite(timeout):
                        timeout += DELIVERY * behaviour.frame.lockstep
                        watched.enter_context(ends_within(timeout, failed))
                    self.executor.remove_node(behaviour.frame.node)
                    behaviour.frame.close()
            self.executor.shutdown()
        realtime.release_collector()


SIGNALS = (signal.SIGINT, signal.SIGTERM)


def obey_signals(loop: NodeLoop) -> None:
    """SIGINT and SIGTERM end the loop between two callbacks, and a node that is still being built at once.

    One Ctrl-C may come several times, from the terminal and from a launcher: what follows within SIGNAL_REPEAT is the
    same wish. Who asks again later, since a node hangs, ends the process there and then.
    """
    first = 0.0

    def handle(number: int, _frame: Any) -> None:
        nonlocal first
        now = time.monotonic()
        if first and now - first > SIGNAL_REPEAT:
            os.write(2, b"ended at once; the nodes were not closed\n")
            os._exit(128 + number)
        first = first or now
        loop.stop()
        if not loop.running:  # nothing moves yet, and a compiler does not survive what is thrown into it
            os._exit(0)

    for number in SIGNALS:
        signal.signal(number, handle)


def _wrong_arguments(arguments: Sequence[str], error: RuntimeError) -> ShakeError:
    text = " ".join(str(error).split()).split(", at /")[0]
    return ShakeError(f"ROS arguments {' '.join(arguments)}: {text[:300]}")


@contextmanager
def ros_context(arguments: Sequence[str] | None = None, domain_id: int | None = None) -> Iterator[Context]:
    """An initialised rclpy context of our own, with no signal handlers of rclpy.

    Nodes are discovered and listen on this machine alone, unless the environment
    opens the range (docs/howto/network.md).
    Fast DDS gets the profiles of config/, unless the environment names others.
    """
    local = os.environ.setdefault(DISCOVERY_RANGE, LOCAL[0]) in LOCAL
    profiles = config_folder() / ("fastdds.xml" if local else "fastdds_network.xml")
    if profiles.is_file():
        os.environ.setdefault("FASTDDS_DEFAULT_PROFILES_FILE", str(profiles))
    context = Context()
    try:
        rclpy.init(
            args=None if arguments is None else list(arguments),
            context=context,
            domain_id=domain_id,
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except RuntimeError as error:
        raise _wrong_arguments(arguments or [], error) from None
    try:
        yield context
    finally:
        context.try_shutdown()


def build_node(
    build: Build,
    name: str,
    context: Context,
    arguments: Sequence[str] | None = None,
    process_arguments: Sequence[str] = (),
) -> Behaviour:
    """Frame and behaviour of one node; its unknown parameter overrides are an error.

    Its ROS arguments are `arguments`, or where that is None those of the process, to be given too.
    """
    frame = Frame(name, context, arguments)
    shared, warnings = read_parameter_files(frame.node.get_fully_qualified_name(), arguments or process_arguments)
    for line in warnings:
        frame.say(WARN, line)
    slow = "compiling, as at every first start; this may take a minute"
    compiling = threading.Timer(SLOW_START, lambda: frame.say(OK, f"{frame.start_line}; {slow}"))
    compiling.daemon = True
    compiling.start()
    try:
        behaviour = build(frame)
        frame.parameters.check_overrides(shared)
    except BaseException as error:
        frame.node.destroy_node()  # while its context lives: what the interpreter takes down last may crash
        if isinstance(error, InvalidQosOverridesError):
            raise ShakeError(error) from None
        raise
    finally:
        compiling.cancel()
    frame.say(OK, frame.start_line)
    return behaviour


def main(build: Build, name: str, arguments: Sequence[str]) -> int:
    """Run one node as this process; `arguments` are the ROS arguments after its name. Returns the exit code."""
    try:
        foreign = remove_ros_args(["program", *arguments])[1:]
    except RuntimeError as error:
        raise _wrong_arguments(arguments, error) from None
    if foreign:
        raise ShakeError(f"'{foreign[0]}' is no ROS argument; parameters go after --ros-args -p name:=value")
    with ros_context(list(arguments)) as context:
        loop = NodeLoop(context)
        obey_signals(loop)
        try:
            loop.add(build_node(build, name, context, process_arguments=arguments))
            loop.run()
        finally:
            loop.close(TAKEN_DOWN)
            for number in SIGNALS:  # a late one must not disturb what is taken down from here on
                signal.signal(number, signal.SIG_IGN)
    return 0

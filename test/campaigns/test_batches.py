"""Tasks on worker processes: nothing is lost, doubled or changed, whatever happens to a worker."""

from __future__ import annotations

import json
import os
import signal
import threading
import time
from concurrent.futures import Executor, Future
from pathlib import Path

import pytest

from shake_ros.campaigns.batches import BATCH, Task, TaskOutcome, function_of, run
from shake_ros.campaigns.engine import Engine, ProcessWorkers, WorkerDied, engine
from shake_ros.quantities import ShakeError

TASKS = "benchmarks.campaign.tasks"
EACH = 0.005  # [s]


def tasks(count: int, **more):
    return (Task(str(seed), {"seed": seed, **more}) for seed in range(count))


def outcomes(on: Engine, function: str, given) -> dict[str, TaskOutcome]:
    found = [outcome for batch in run(on, f"{TASKS}:{function}", given) for outcome in batch]
    assert len({o.task.key for o in found}) == len(found), "a task was done twice"
    return {o.task.key: o for o in found}


@pytest.fixture(scope="module")
def two_workers():
    with engine(workers=2) as found:
        yield found


@pytest.fixture(scope="module")
def undisturbed() -> dict[str, str]:
    """The figures as this process makes them."""
    sums = function_of(f"{TASKS}:sums")
    return {str(seed): json.dumps(sums(seed), sort_keys=True) for seed in range(60)}


def test_the_rows_are_those_of_one_process_to_the_last_bit(two_workers, undisturbed):
    found = outcomes(two_workers, "sums", tasks(60))
    assert {key: o.figures for key, o in found.items()} == undisturbed


def test_a_worker_killed_in_the_middle_changes_no_row(two_workers, undisturbed, tmp_path):
    found = outcomes(two_workers, "deadly", tasks(60, bad=31, folder=str(tmp_path), times=1))
    assert len(list(tmp_path.iterdir())) == 1
    assert {key: o.figures for key, o in found.items()} == undisturbed


def test_a_task_whose_worker_dies_twice_has_failed_and_the_rest_goes_on(two_workers, undisturbed, tmp_path):
    found = outcomes(two_workers, "deadly", tasks(60, bad=31, folder=str(tmp_path), times=9))
    assert len(list(tmp_path.iterdir())) == 2 + (len(found) < 60)
    assert found.pop("31").failed == "its worker died twice"
    assert {key: o.figures for key, o in found.items()} == {k: v for k, v in undisturbed.items() if k != "31"}


def test_a_task_that_raises_says_why_and_the_others_are_done(two_workers):
    found = outcomes(two_workers, "failing", tasks(6))
    odd = ["ValueError: seed 1 is odd", "ValueError: seed 3 is odd"]
    assert [found[str(seed)].failed for seed in range(4)] == [None, odd[0], None, odd[1]]


def test_tasks_are_asked_for_only_when_they_can_be_given_out(two_workers):
    asked = 0

    def counted():
        nonlocal asked
        for asked in range(1, 10_001):
            yield Task(str(asked), {"seed": asked})

    batches = run(two_workers, f"{TASKS}:busy", (Task(t.key, {**t.given, "seconds": 0.02}) for t in counted()))
    for _ in range(6):
        next(batches)
    ahead = asked
    batches.close()
    assert ahead < 150


class Clockwork(Executor):
    """Tasks that take exactly EACH by their own account, whatever the machine does meanwhile."""

    def submit(self, _work, _function, given, *_):
        done = Future()
        done.set_result([TaskOutcome(task, "{}", None, EACH, EACH, "here") for task in given])
        return done


def test_short_tasks_go_out_in_batches_that_take_a_tenth_of_a_second():
    even = Engine("clockwork", Clockwork(), lambda: 2, 1, (), sure=True)
    batches = sorted(len(batch) for batch in run(even, f"{TASKS}:busy", tasks(240)))
    assert sum(batches) == 240
    singles = even.width()  # before a time is known
    assert batches[:singles] == [1] * singles
    assert [EACH * n for n in batches[singles + 1 :]] == pytest.approx([BATCH] * 7)  # one has what is left
    assert BATCH > 0.1


def test_short_tasks_of_workers_are_done_in_few_batches(two_workers):
    given = (Task(str(seed), {"seed": seed, "seconds": 0.005}) for seed in range(240))
    assert sum(1 for _ in run(two_workers, f"{TASKS}:busy", given)) < 60


def test_a_call_that_kills_its_worker_takes_no_other_along():
    with ProcessWorkers(1) as pool:
        worker = pool.submit(os.getpid).result()
        sleeping = pool.submit(time.sleep, 60.0)
        after = pool.submit(os.getpid)
        while not sleeping.running():
            time.sleep(0.01)
        time.sleep(0.1)
        os.kill(worker, signal.SIGKILL)
        with pytest.raises(WorkerDied):
            sleeping.result()
        assert after.result() not in (worker, os.getpid())


def test_ended_at_once_no_worker_is_left():
    pool = ProcessWorkers(1)
    worker = pool.submit(os.getpid).result()
    pool.submit(time.sleep, 60.0)
    start = time.monotonic()
    ending = threading.Thread(target=lambda: pool.shutdown(cancel_futures=True))
    ending.start()
    ending.join(20.0)
    assert time.monotonic() - start < 20.0
    assert not Path(f"/proc/{worker}").exists()


def test_a_call_whose_worker_is_ended_before_it_begins_fails_as_one_whose_worker_died(monkeypatch):
    with ProcessWorkers(1) as workers:
        seat = workers._all[0]
        started = seat._started

        def ended_meanwhile():
            worker = started()
            seat.end(at_once=True)
            return worker

        monkeypatch.setattr(seat, "_started", ended_meanwhile)
        with pytest.raises(WorkerDied):
            workers.submit(os.getpid).result(timeout=60.0)


@pytest.mark.parametrize("name", ["benchmarks.campaign.tasks:nobody", "no_such_module:f", "math", "math:pi"])
def test_what_is_no_function_is_refused(name):
    with pytest.raises(ShakeError, match="is not a function"):
        function_of(name)


def test_workers_are_at_least_one():
    with pytest.raises(ShakeError, match="0 workers"), engine(workers=0):
        pass

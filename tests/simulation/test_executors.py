"""Sweeps that other processes and a cluster carry: the same numbers, nothing lost."""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core.errors import InputError

from ..cases.ensembles import T, lag, last, noise, ramp, step_response

pytestmark = pytest.mark.usefixtures("interpreted")

GAINS, TAUS = np.linspace(0.5, 2, 7), np.linspace(0.05, 0.5, 7)
TABLE = {"lag.gain": GAINS, "lag.tau": TAUS}


@pytest.fixture(scope="module")
def pool() -> Iterator[ProcessPoolExecutor]:
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as made:
        yield made


def leave(member: int) -> float:
    if member == 4:
        os._exit(1)
    return 1.0


def test_processes_of_the_users(pool: ProcessPoolExecutor) -> None:
    here = lg.sweep(lag(), T, 1.0, TABLE, states=True)
    there = lg.sweep(lag(), T, 1.0, TABLE, states=True, executor=pool, chunk=2)
    assert np.array_equal(here.y, there.y) and np.array_equal(here.x, there.x)
    assert np.allclose(there["y"], step_response(GAINS, TAUS), atol=1e-5)
    short = lg.sweep(lag(), T, 1.0, TABLE, reduce=last, executor=pool, chunk=3)
    assert np.array_equal(short.reduced, here.y[:, :, -1])


def test_random_inputs_do_not_depend_on_who_works(pool: ProcessPoolExecutor) -> None:
    here = lg.sweep(lag(), T, noise, seeds=9)
    assert np.array_equal(lg.sweep(lag(), T, noise, seeds=9, executor=pool, chunk=4).y, here.y)
    with ThreadPoolExecutor(3) as threads:
        assert np.array_equal(lg.sweep(lag(), T, noise, seeds=9, executor=threads).y, here.y)


def test_failures_come_home(pool: ProcessPoolExecutor) -> None:
    with pytest.warns(RuntimeWarning, match="1 of 7 members failed; member 3: inputs: Lookup"):
        s = lg.sweep(lag(), T, ramp, TABLE, executor=pool, chunk=3)
    assert set(s.failed) == {3} and np.isfinite(s.y[s.ok]).all() and s.ok.sum() == 6


@pytest.mark.slow
def test_a_worker_that_dies_without_numba_costs_its_task() -> None:
    with pytest.warns(
        RuntimeWarning, match="1 of 7 members failed; member 4: its worker process died"
    ):
        s = lg.sweep(lag(), T, leave, TABLE, jobs=2, chunk=1)
    assert np.allclose(s["y"][s.ok], step_response(GAINS, TAUS)[s.ok], atol=1e-5)


def test_functions_that_cannot_be_sent_are_said_at_once(pool: ProcessPoolExecutor) -> None:
    for given in ({"executor": pool}, {"jobs": 2}):
        with pytest.raises(InputError, match="inputs cannot be sent .* top of a module"):
            lg.sweep(lag(), T, lambda i: 1.0, TABLE, **given)
        with pytest.raises(InputError, match="reduce cannot be sent"):
            lg.sweep_chunks(lag(), T, 1.0, TABLE, reduce=lambda t, y: 0, **given)


class Interrupted(Executor):
    """Two tasks are done; then Ctrl-C is pressed."""

    def __init__(self) -> None:
        self.futures: list[Future] = []

    def submit(self, fn, /, *args, **kwargs):
        if len(self.futures) == 4:
            raise KeyboardInterrupt
        future: Future = Future()
        self.futures.append(future)
        if len(self.futures) <= 2:
            future.set_result(fn(*args))
        return future


def test_an_interrupt_keeps_what_the_executor_has_done() -> None:
    executor = Interrupted()
    with pytest.warns(RuntimeWarning, match="interrupted: 2 of 7 members are done"):
        s = lg.sweep(lag(), T, 1.0, TABLE, executor=executor, chunk=1)
    assert s.done.tolist() == [True] * 2 + [False] * 5
    assert np.isfinite(s.y[:2]).all() and np.isnan(s.y[2:]).all()
    assert all(f.cancelled() for f in executor.futures[2:])


def test_a_stream_that_is_interrupted_ends_with_the_interrupt() -> None:
    parts = []
    with pytest.raises(KeyboardInterrupt):
        for part in lg.sweep_chunks(lag(), T, 1.0, TABLE, executor=Interrupted(), chunk=1):
            parts.append(part.members.tolist())
    assert parts == [[0], [1]]

"""Jobs on executors: nothing is lost, nothing piles up."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest

from lugrectl.core.errors import Refused
from lugrectl.core.jobs import JobError, run_jobs


def square(x: float) -> float:
    if x == 3:
        raise Refused("three cannot be answered.")
    if x == 5:
        raise FileNotFoundError(2, "No such file", "five.csv")
    return x * x


def fragile(x: int) -> int:
    if x == 4:
        os._exit(9)
    return -x


EXPECTED = {i: i * i for i in range(8) if i not in (3, 5)}


def check_squares(found: dict[int, object]) -> None:
    errors = {i: e for i, e in found.items() if isinstance(e, JobError)}
    assert {i: v for i, v in found.items() if i not in errors} == EXPECTED
    assert (errors[3].sentence, errors[3].exit_code) == ("three cannot be answered.", 3)
    assert "five.csv" in errors[5].sentence and errors[5].exit_code == 2
    assert [errors[i].index for i in (3, 5)] == [3, 5]


def test_inline_and_on_threads() -> None:
    check_squares(dict(run_jobs(square, range(8))))
    with ThreadPoolExecutor(2) as pool:
        check_squares(dict(run_jobs(square, range(8), executor=pool)))


@pytest.mark.slow
def test_on_processes_one_of_which_dies() -> None:
    """The item that kills its worker is an error; its neighbours are not."""
    found = dict(run_jobs(fragile, range(8), jobs=2))
    died = found.pop(4)
    assert found == {i: -i for i in range(8) if i != 4}
    assert isinstance(died, JobError) and died.index == 4 and "process died" in died.sentence


def test_failures_cross_processes() -> None:
    check_squares(dict(run_jobs(square, range(8), jobs=2)))


def test_items_are_taken_as_they_are_needed() -> None:
    taken: list[int] = []

    def endless() -> Iterator[int]:
        while True:
            taken.append(len(taken))
            yield taken[-1]

    with ThreadPoolExecutor(2) as pool:
        found = run_jobs(float, endless(), executor=pool)
        for _ in range(100):
            next(found)
        found.close()
    assert len(taken) <= 100 + 5


def test_an_early_end_leaves_nothing_running() -> None:
    """Processes that would sleep for a minute are ended."""
    start, found = time.monotonic(), run_jobs(time.sleep, [0.0, 60.0, 60.0], jobs=2)
    next(found)
    found.close()
    assert time.monotonic() - start < 30
    deadline = time.monotonic() + 10
    while any("ExecutorManager" in type(t).__name__ for t in threading.enumerate()):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_shut_down_executor_is_reported_for_each_job() -> None:
    with ThreadPoolExecutor(1) as pool:
        pass
    found = dict(run_jobs(float, range(3), executor=pool))
    assert [found[i].sentence.startswith("RuntimeError") for i in range(3)] == [True] * 3

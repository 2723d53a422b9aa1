"""Work side by side."""

from __future__ import annotations

import threading

import pytest

from lugrectl.engine.runtime.backend import compiler, each_beside, threads


def test_results_come_in_the_order_of_the_items():
    assert [*each_beside(lambda x: x * x, iter(range(9)))] == [x * x for x in range(9)]
    assert [*each_beside(str, [])] == []


def test_what_goes_wrong_is_raised():
    with pytest.raises(ZeroDivisionError):
        list(each_beside(lambda x: 1 / x, [1, 0, 2]))


@pytest.mark.skipif(compiler() is None, reason="all is done in turn without compiled code")
def test_work_runs_at_once_and_starts_no_more_threads(monkeypatch):
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    meeting = threading.Barrier(2, timeout=20.0)

    def work(item: int) -> int:
        meeting.wait()
        return threads()

    assert [*each_beside(work, [0, 1])] == [1, 1]
    assert threads() == 2

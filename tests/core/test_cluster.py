"""A cluster of two worker processes carries sweeps; a killed worker costs no member."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import lugrectl as lg

from ..cases.ensembles import T, lag, noise, step_response

pytestmark = pytest.mark.slow
MEMBERS = 12
GAINS, TAUS = np.linspace(0.5, 2, MEMBERS), np.linspace(0.05, 0.5, MEMBERS)
TABLE = {"lag.gain": GAINS, "lag.tau": TAUS}


@pytest.fixture
def client() -> Iterator[Any]:
    distributed = pytest.importorskip("distributed")
    import dask

    quiet = {"distributed.worker.daemon": True, "distributed.admin.log-length": 0}
    options = {"n_workers": 2, "threads_per_worker": 1, "processes": True}
    with (
        dask.config.set(quiet),
        distributed.LocalCluster(**options, dashboard_address=None) as cluster,
        distributed.Client(cluster) as made,
    ):
        pids = set(made.run(os.getpid).values())
        assert len(pids) == 2 and os.getpid() not in pids
        yield made


class Killer:
    """A progress callback that kills one worker process when a share of the work is done."""

    def __init__(self, client: Any, share: float) -> None:
        self.client, self.share, self.killed = client, share, 0

    def __call__(self, fraction: float, what: str = "") -> None:
        if fraction >= self.share and not self.killed:
            self.killed = min(self.client.run(os.getpid).values())
            os.kill(self.killed, signal.SIGKILL)

    def really(self) -> bool:
        """Whether the process is gone, and the cluster has another one in its place or fewer."""
        return self.killed > 0 and self.killed not in self.client.run(os.getpid).values()


def slowly(member: int) -> float:
    """A unit step that takes its time, so that a kill meets work in progress."""
    time.sleep(0.15)
    return 1.0


def test_a_sweep_on_two_processes_is_that_of_this_process(client: Any) -> None:
    here = lg.sweep(lag(), T, noise, TABLE, seeds=MEMBERS, states=True)
    executor = client.get_executor()
    there = lg.sweep(lag(), T, noise, TABLE, seeds=MEMBERS, states=True, executor=executor, chunk=2)
    assert np.array_equal(here.y, there.y) and np.array_equal(here.x, there.x)


def test_a_worker_killed_during_a_sweep_loses_no_member(client: Any) -> None:
    killer = Killer(client, 0.5)
    found = lg.sweep(
        lag(), T, slowly, TABLE, executor=client.get_executor(), chunk=1, progress=killer
    )
    assert killer.really()
    assert found.done.all() and not found.failed
    assert np.allclose(found["y"], step_response(GAINS, TAUS), atol=1e-4)

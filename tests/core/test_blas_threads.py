"""The threads of linear algebra."""

from collections.abc import Iterator

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict
from lugrectl.core.blas_threads import one_blas_thread

pools = pytest.importorskip("threadpoolctl")


def threads() -> set[int]:
    return {p["num_threads"] for p in pools.threadpool_info() if p["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two() -> Iterator[None]:
    """As on a user's machine, whatever the tests are run with."""
    with pools.threadpool_limits(limits=2, user_api="blas"):
        yield


def test_inside_it_is_one_and_afterwards_what_it_was():
    assert threads() == {2}
    with one_blas_thread():
        assert threads() == {1}
    assert threads() == {2}


class Enough(Exception):
    """Ends a diagnosis at its first step."""


@pytest.mark.parametrize("work", [lg.identify, lg.diagnose])
def test_what_is_done_with_a_record_takes_one(work):
    t = np.arange(0.0, 20.0, 0.01)
    w = 5.0 * np.sin(t)
    record = lg.Record(t=t, w=w, u=0.5 * np.sign(w) + 0.05 * np.cos(t))
    model = model_from_dict({"plant": {"J": 0.05}, "friction": {"model": "coulomb"}}, "here")

    def look(fraction: float, what: str) -> None:
        assert threads() == {1}
        raise Enough

    with pytest.raises(Enough):
        work(record, model, progress=look)
    assert threads() == {2}

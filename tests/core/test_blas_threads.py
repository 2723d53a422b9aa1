"""The threads of linear algebra."""

from collections.abc import Iterator

import pytest

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

"""What holds for all tests."""

import gc
import os
import sys
from collections.abc import Iterator
from typing import Any
from zlib import crc32

# Before NumPy is loaded: its threads cost more on small matrices than they give.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import matplotlib  # noqa: E402
import pytest  # noqa: E402
from hypothesis import settings  # noqa: E402

from lugrectl.blocks import declaration  # noqa: E402
from lugrectl.blocks.block import REGISTRY, registered  # noqa: E402
from lugrectl.engine.backend import has_compiler

from .cases.own_blocks import momentum, smooth  # noqa: E402, F401  fixtures

matplotlib.use("Agg")  # here: a kernel that a test starts chooses for itself
# no deadline: the machine may be slow, or busy with another test
settings.register_profile("few", deadline=None, max_examples=25)
settings.register_profile("many", deadline=None, max_examples=200)
settings.load_profile("few")  # --hypothesis-profile many


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of many cases the first runs always; a third of the long scenarios is in the sample, always
    the same ones and one of each test at most."""
    begun: set[str] = set()
    sampled: set[str] = set()
    for item in items:
        test = item.nodeid.partition("[")[0]
        if item.get_closest_marker("scenario") and test not in sampled:
            if crc32(item.nodeid.encode()) % 3 == 0:
                item.add_marker("sample")
                sampled.add(test)
        if item.get_closest_marker("cases") and test in begun:
            item.add_marker("slow")
        begun.add(test)


def pytest_collection_finish() -> None:
    """What collecting has made stays: the garbage collector need not look through it each time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Each core takes files in a row, so that what the tests of a file share is made once."""
    from xdist.scheduler import WorkStealingScheduling

    return WorkStealingScheduling(config, log) if config.getoption("dist") == "load" else None


def pytest_configure(config: pytest.Config) -> None:
    """Compiled code stays for the next run, and both workers find it, unless it has a place."""
    made = getattr(config, "cache", None)
    if made is not None:
        os.environ.setdefault("LUGRECTL_CACHE", str(made.mkdir("lugrectl")))


@pytest.fixture(autouse=True)
def no_figure_stays() -> Iterator[None]:
    """Each test starts without figures of pyplot."""
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")


@pytest.fixture(autouse=True)
def no_block_stays() -> Iterator[None]:
    """The blocks that a test declares go with it, and the files that it loads."""
    before, loaded = set(registered()), dict(declaration.LOADED)
    yield
    for key in set(REGISTRY) - before:
        del REGISTRY[key]
    declaration.LOADED.clear()
    declaration.LOADED.update(loaded)


def there(backend: str | None) -> str | None:
    """The backend, or the test skipped where this machine has no such compiler."""
    if backend == "numba":
        pytest.importorskip("numba")
    if backend == "c" and not has_compiler():
        pytest.skip("there is no C compiler")
    return backend


@pytest.fixture(params=["python", "c"])
def backend(request: pytest.FixtureRequest) -> str | None:
    """Each way to run lanes; numba reads the text that C is made of."""
    return there(request.param)


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Simulations run in plain Python, from nothing that was kept: nothing to compile."""
    monkeypatch.setattr("lugrectl.engine.adaptive_run.compiler", lambda: None)
    monkeypatch.setattr("lugrectl.engine.memo._traced", {})


@pytest.fixture(params=["c", "python"])
def way(request: pytest.FixtureRequest, interpreted: None, monkeypatch: pytest.MonkeyPatch) -> str:
    """Each way to run a single system; numba reads the text that C is made of."""
    made_by = None if request.param == "python" else there(request.param)
    monkeypatch.setattr("lugrectl.engine.adaptive_run.compiler", lambda: made_by)
    return request.param

"""Who sees the progress of long work, and where."""

import io
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.core import progress
from lugrectl.core.errors import InputError
from lugrectl.core.progress import Bar, bar_for, shows_progress
from lugrectl.paper import reproduce

from ..cases.logs import csv as log

T = np.linspace(0.0, 1.0, 101)
PI = lg.pi(1.6, 0.16)
TABLE = {"pi.kp": np.linspace(1.0, 2.0, 4)}


class Screen(io.StringIO):
    def isatty(self):
        return True


def terminal(monkeypatch):
    """A terminal as stderr."""
    monkeypatch.setattr(sys, "stderr", Screen())
    return sys.stderr


@pytest.fixture
def kernel(monkeypatch):
    """As if a Jupyter kernel ran this."""
    monkeypatch.setattr(progress, "in_notebook", lambda: True)


@pytest.mark.parametrize("wanted", [None, False, True])
def test_a_bar_is_shown_on_a_terminal_where_it_is_asked_for_and_taken_away(wanted, monkeypatch):
    screen = terminal(monkeypatch)
    parts = list(lg.sweep_chunks(PI, T, T, TABLE, chunk=1, progress=wanted))
    said = screen.getvalue()
    assert len(parts) == 4 and (" of 4 members" in said and said.endswith("\r\x1b[K")) == bool(
        wanted
    )
    for stream in (io.StringIO(), None):  # a file, or nothing, shows none
        monkeypatch.setattr(sys, "stderr", stream)
        with bar_for(wanted) as bar:
            bar(0.5, "half way")
        assert stream is None or stream.getvalue() == ""


def test_a_function_gets_every_report():
    said = []
    lg.sweep(PI, T, T, TABLE, progress=lambda part, what: said.append((part, what)), chunk=1)
    assert said[-1] == (1.0, "4 of 4 members") and len(said) == 4


def test_long_work_takes_every_kind_of_progress():
    """Each of them is wrapped by the one place that decides."""
    fits = (lg.diagnose, lg.identify, lg.compensate, lg.sweep, lg.diagnose_each)
    for work in (*fits, lg.compare_observers, lg.recommend_observer):
        with pytest.raises(InputError, match="progress must be"):
            work("any", "thing", progress="yes")
    with pytest.raises(InputError, match="progress must be"):
        reproduce(progress="yes")


# --- notebooks ---------------------------------------------------------------------------


@pytest.mark.slow
def test_the_paper_and_a_compensation_report():
    said = []
    reproduce(only=["initial"], progress=lambda part, what: said.append(part))
    assert said and said[-1] == 1.0
    said = []
    given = {"reference": (T, np.sin(4.0 * T)), "progress": lambda part, what: said.append(what)}
    lg.compensate(lg.Model.of(lg.table1()), **given)
    assert len(said) == 3 and all(what.startswith("simulating the loop ") for what in said)


def test_a_notebook_gets_a_bar_without_asking(kernel):
    assert isinstance(bar_for(None), Bar) and isinstance(bar_for(True), Bar)
    assert not isinstance(bar_for(False), Bar)
    with bar_for(None) as bar:  # short work gets none
        bar(0.0, "begin")
        bar(1.0, "end")
    assert not bar._begun


def test_only_a_kernel_is_a_notebook(monkeypatch):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    assert not progress.in_notebook()
    # IPython was imported but does not run this, runs on a terminal, runs in a kernel
    for shell, is_one in ((None, False), (object(), False), (SimpleNamespace(kernel=1), True)):
        fake = SimpleNamespace(get_ipython=lambda shell=shell: shell)
        monkeypatch.setitem(sys.modules, "IPython", fake)
        assert progress.in_notebook() == is_one


def test_the_plain_bar_of_a_notebook_escapes_and_goes(monkeypatch):
    display = pytest.importorskip("IPython.display")
    shown = []
    place = SimpleNamespace(update=lambda html: shown.append(html.data))
    monkeypatch.setattr(display, "display", lambda html, **_: place.update(html) or place)
    with Bar(progress.in_cell()) as bar:
        bar(0.25, "<b>")
    assert shown == ['<progress max="1" value="0.250"></progress> 25 % &lt;b&gt;', ""]


def test_the_bar_goes_when_the_work_fails(monkeypatch):
    screen = terminal(monkeypatch)

    @shows_progress
    def work(*, progress=None):
        progress(0.1, "soon")
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken"):
        work(progress=True)
    assert screen.getvalue().endswith("\r\x1b[K")


def test_one_bar_for_a_whole_fleet(kernel, monkeypatch, tmp_path):
    """The diagnoses inside must not open bars of their own, in threads neither."""
    from concurrent.futures import ThreadPoolExecutor

    made = []
    monkeypatch.setattr(progress, "in_cell", lambda: made.append(1) or progress.silent)
    model = lg.Model.of(lg.table1())
    with ThreadPoolExecutor(2) as pool:
        fleet = lg.diagnose_each([log(tmp_path, name="short.csv")], model, executor=pool)
    assert len(fleet.outcomes) == 1 and made == [1]

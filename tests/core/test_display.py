"""How objects show themselves: a few lines with units, HTML that no name can break."""

import ast
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

import lugrectl as lg
from lugrectl.blocks.block import members
from lugrectl.core.display import Row, Shown, brief, noticed, with_interval
from lugrectl.core.errors import InputError
from lugrectl.diagnosis.result import Diagnosis
from lugrectl.estimates.findings import Estimate

from ..cases.html_page import Page
from ..cases.made_up import HOSTILE, diagnosis
from ..cases.shown_results import friction_map, identification, table

P = lg.table1()
T = np.linspace(0.0, 1.0, 101)


@pytest.fixture(scope="module")
def compensation():
    t = np.linspace(0.0, 0.5, 201)
    return lg.compensate(lg.Model.of(P), reference=(t, np.sin(4.0 * t)))


@pytest.fixture(scope="module")
def sweep():
    return lg.sweep(lg.pi(1.6, 0.16), T, np.sin(T), {"pi.kp": np.linspace(1.0, 2.0, 5)})


@pytest.fixture(scope="module")
def things(compensation, sweep):
    d = diagnosis()
    return {
        "Diagnosis": d,
        "refusal": diagnosis("refused"),
        "Identification": identification(),
        "Record": d.record,
        "Model": d.model,
        "Parameters": P,
        "Part": d.model.effects[0],
        "Block": members("friction")["lugre"],
        "Compensation": compensation,
        "Certificate": lg.certify(P, -10.24, 22.0),
        "Design": lg.design_gains(P, "time-varying"),
        "Sweep": sweep,
        "Fleet": lg.Fleet((), unfinished=(HOSTILE,), model=replace(d.model, name=HOSTILE)),
        "Table": table(),
        "FrictionMap": friction_map(),
        "Finding": d.effects[0],
        "Candidate": d.ranking[0],
        "Estimate": d.estimates["J"],
        "Traces": d.traces,
        "L2Verdict": lg.l2_check(P, K2=22.0),
        "SprVerdict": lg.spr_check(lg.position_T(P, kp=15.0)),
        "BandwidthVerdict": lg.bandwidth_check(lg.velocity_loop_tf(P, kp=1.6, ki=0.16)),
        "DesignChecks": lg.check_designs(P, kp=np.linspace(1.0, 2.0, 9), K2=22.0),
        "Excitation": lg.excitation(np.sin(6.3 * T), T),
        "parameters": d.parameters,
    }


def test_every_object_shows_itself_in_a_few_lines_and_in_html_that_is_safe(things):
    for key, thing in things.items():
        said = repr(thing)
        assert 0 < len(said) < 1200 and len(said.splitlines()) <= 20, key
        assert max(map(len, said.splitlines())) <= 100, key
        assert " at 0x" not in said and "array(" not in said and "function" not in said, key
        page = Page(thing._repr_html_())  # fails for a tag that is left open
        assert "script" not in page.tags and page.said, key


@pytest.mark.parametrize(
    "key, lines",
    [
        ("Model", ["Model drive: rotary, lugre friction", "sigma0 260 N m/rad"]),
        ("Parameters", ["Parameters", "J 0.0022 kg m2", "vs 0.01 rad/s"]),
        ("Record", ["samples 12000 at 1000 Hz, 12 s", "u -0.3 to 0.3 N m"]),
        ("Estimate", ["0.00220 kg m2 (0.00213 to 0.00227)"]),
        ("Finding", ["Finding: torque_ripple", "amplitude 0.0501 N m (0.0489 to 0.0513)"]),
        ("L2Verdict", ["L2Verdict: holds", "gain 0.0846154 s", "frequency 0 rad/s"]),
        ("SprVerdict", ["SprVerdict: does not hold", "margin 0 1/s", "band_edge 82.5723 rad/s"]),
        ("BandwidthVerdict", ["bandwidth 725.648 rad/s", "hertz 115.49 Hz"]),
        ("Design", ["K1 -1.58889 +0.953333 |w|/h(w)"]),
        ("Certificate", ["Certificate certify: holds, rate 95.3093 1/s"]),
        ("Block", ["Block lugre (friction)", "inputs w", "sigma1 0.6 N m s/rad"]),
        ("Sweep", ["Sweep pi: 5 of 5 members simulated, 101 samples to 1 s."]),
        ("Table", ["values 3 values, -0.1 to 0.2 N m"]),
        ("FrictionMap", ["runs 4 (2 held out)", "swing, order 2 0.0100 N m (0.0080 to 0.0120)"]),
        ("Identification", ["J 0.00220 kg m2 (0.00213 to 0.00227)"]),
        ("refusal", ["Diagnosis: refused", "reason u is constant."]),
    ],
)
def test_values_stand_with_their_units(things, key, lines):
    said = [" ".join(line.split()) for line in repr(things[key]).splitlines()]
    assert not set(lines) - set(said)


def test_arrays_are_shown_by_size_and_range():
    assert brief(np.arange(12000.0)) == "12000 values, 0 to 11999"
    assert brief(np.array([np.nan, np.inf])) == "2 values"
    assert brief(np.zeros((2, 3))) == "2 x 3 values, 0 to 0"
    assert brief(np.array([True, False])) == "1 of 2"
    assert brief(list(range(100))) == "0, 1, 2, 3, 4, 5 and 94 more"


def test_names_with_line_breaks_stay_on_their_line():
    class Odd(Shown):
        def _rows(self):
            return [Row("a", "one\ntwo", "N m")]

    assert repr(Odd()) == "Odd\n  a  one two N m"
    said = repr(replace(lg.Model.of(P), name="two\nlines"))
    assert said.splitlines()[0] == "Model two lines: rotary, lugre friction"


# --- pictures ----------------------------------------------------------------------------


@pytest.fixture(params=["Identification", "Compensation", "Sweep", "Table", "FrictionMap"])
def drawable(request, things):
    return things[request.param]


def test_plots_show_in_pyplot_and_return_their_axes(drawable):
    axes = np.atleast_1d(drawable.plot())
    assert plt.get_fignums() == [axes[0].figure.number]
    assert all(ax.has_data() and ax.figure is axes[0].figure for ax in axes)


def test_plots_draw_into_the_axes_given(drawable):
    ax = Figure().subplots()
    assert drawable.plot(ax=ax) is ax and ax.has_data()
    assert not plt.get_fignums()


def test_what_cannot_be_drawn_leaves_no_figure_behind(compensation):
    empty = lg.sweep(lg.pi(1.6, 0.16), T, np.sin(T), {"pi.kp": [1.0]}, reduce=lambda t, y: 1.0)
    for thing in (empty, Diagnosis("adequate"), diagnosis("refused")):
        with pytest.raises(InputError, match="to plot"):
            thing.plot()
    assert not plt.get_fignums()


@pytest.mark.slow
def test_pages_leave_no_figure_behind_and_the_users_style_stays_his(tmp_path):
    before = dict(plt.rcParams)
    figure = diagnosis().plot()[0].figure.number
    diagnosis()._repr_html_()
    diagnosis().save(tmp_path)
    assert plt.get_fignums() == [figure] and dict(plt.rcParams) == before


CELLS = (
    "from tests.cases.made_up import diagnosis",
    "diagnosis().plot()",
    "diagnosis().plot();",
    "axes = diagnosis().plot()",
    "import matplotlib.pyplot as plt; plt.get_fignums()",
)


@pytest.mark.slow
@pytest.mark.sample
@pytest.mark.filterwarnings("ignore")
def test_a_cell_shows_its_picture_once_with_and_without_semicolon(monkeypatch):
    nbclient, nbformat = (pytest.importorskip(name) for name in ("nbclient", "nbformat"))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    cells = [nbformat.v4.new_code_cell(cell) for cell in CELLS]
    notebook = nbformat.v4.new_notebook(cells=cells)
    nbclient.NotebookClient(notebook, timeout=100, kernel_name="python3").execute()
    pictures = [
        sum("image/png" in output.get("data", {}) for output in cell.outputs) for cell in cells
    ]
    assert pictures == [0, 1, 1, 1, 0]
    assert ast.literal_eval(cells[-1].outputs[0]["data"]["text/plain"]) == []


@pytest.mark.parametrize(
    ("interval", "value", "shown"),
    [
        ((75.8123, 75.8198), "75.816", "75.812 to 75.820"),
        ((0.0112, 0.0132), "0.0122", "0.0112 to 0.0132"),
        ((-0.3, 2.9), "1.3", "-0.3 to 2.9"),
        ((1_234_000.0, 1_298_000.0), "1270000", "1230000 to 1300000"),
        ((75.81, 75.84), "75.825", "75.810 to 75.840"),  # never one text
        ((0.28712, 0.28712), "0.28712", "0.28712 +- <0.00001"),
        ((1234.5678, 1234.5678), "1234.6", "1234.6 +- <0.1"),
        ((2e6, 2e6), "2.0000e+06", "2.0000e+06 +- <100"),
        ((3.0, 3.0 + 1e-12), "3.0000000", "3.0000000 +- <1e-7"),
    ],
)
def test_no_digit_says_less_than_the_interval(interval, value, shown):
    assert with_interval(Estimate(sum(interval) / 2, "N m", interval)) == (value, shown)


def test_a_result_prints_what_was_noticed_and_where_the_rest_is():
    few, many = noticed(["one."], "said"), noticed([f"{i}." for i in range(6)], "said")
    assert [row.text() for row in few] == ["one."]
    assert [row.text() for row in many] == ["0.", "1.", "2.", "3.", "in .said"]


def test_a_level_is_not_zero_for_being_uncertain():
    assert with_interval(Estimate(0.3002, "N m", (0.0, 5.0))) == ("0.3", "0 to 5")
    assert float(with_interval(Estimate(2e-5, "N m", (-3e-4, 3e-4)))[0]) == 0.0

"""Reports and plots of made-up diagnoses: what they say, that they are whole and safe."""

import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import matplotlib.pyplot as plt
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from lugrectl import report
from lugrectl.block import members
from lugrectl.errors import InputError
from lugrectl.model import Model, read_model, table1
from lugrectl.record import Record
from lugrectl.report import atomic, plot, views, wording
from lugrectl.results import VERDICTS, Candidate, Diagnosis, Estimate, Finding, Traces

HOSTILE = '<script src="http://x.y/z.js">alert(1)</script> & "q".csv'
A, N, PHI = 0.05, 8.0, -1.0


def traces(n=12000, dt=1e-3, seed=1):
    """A ripple in the residual; every other 2 s held out, worst around t = 6.5 s."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    theta = 5.0 * np.sin(0.4 * np.pi * t)
    w = 2.0 * np.pi * np.cos(0.4 * np.pi * t)
    ripple = A * np.sin(N * theta + PHI)
    held = t // 2.0 % 2 == 1
    worse = 1.0 + 3.0 * (abs(t - 6.8) < 0.5)
    noise = rng.normal(0.0, 0.01, (3, n))
    return Traces(
        t=t,
        measured=w + noise[0],
        held_out=held,
        simulated={
            "refitted": np.where(held, w + 3.0 * worse * ripple, np.nan),
            "augmented": np.where(held, w, np.nan),
        },
        residual={"refitted": ripple + noise[1], "augmented": noise[2]},
        signals={"theta": theta, "w": w, "u": 0.3 * np.sign(w), "t": t},
    )


def effect(name="torque_ripple", **values):
    return Finding(name, {k: Estimate(v, "1", None) for k, v in values.items()})


def diagnosis(verdict="found", **changes):
    model = Model.of(table1())
    tr = traces()
    found = Finding(
        "torque_ripple",
        {
            "amplitude": Estimate(0.05012, "N m", (0.0489, 0.0513)),
            "harmonic": Estimate(N, "1/rev", (7.998, 8.002)),
            "phase": Estimate(PHI, "rad", None),
        },
        (Candidate("periodic_disturbance", 812.0, 0.2),),
    )
    ripple = {"amplitude": 0.05012, "harmonic": N, "phase": PHI}
    d = Diagnosis(
        verdict,
        (found,) if verdict in ("found", "ambiguous") else (),
        depends_on=("theta",) if verdict in ("found", "ambiguous", "unexplained") else (),
        experiment="record slow moves both ways" if verdict in ("ambiguous", "refused") else None,
        error={
            "signal": "w",
            "unit": "rad/s",
            "samples": 6000,
            "horizon": 1.0,
            "declared": None,
            "refitted": 0.21,
            "augmented": 0.021,
            "noise_floor": 0.0101,
        },
        free_error={
            "signal": "w",
            "unit": "rad/s",
            "in_sample": True,
            "declared": math.nan,
            "refitted": 0.4,
            "augmented": 0.1,
        },
        torque_error={"unit": "N m", "declared": 0.04, "refitted": 0.036, "augmented": 0.0022},
        model=model.with_effect("torque_ripple", ripple),
        declared=model.with_values({"J": 0.0024, "Fv": None}),
        estimates={"J": Estimate(0.0022, "kg m2", (0.002134, 0.002266))},
        record=Record(t=tr.t, u=tr.signals["u"], w=tr.measured, source=HOSTILE),
        messages=(f"{HOSTILE}: t has doubled stamps",),
        ranking=(
            Candidate("torque_ripple", 15321.0, 0.93),
            Candidate("gravity", 3.0, 0.04),
            Candidate("input_delay", -0.1, 0.0),
            Candidate("constant_torque", math.nan, 0.0),
        ),
        traces=tr,
    )
    if verdict == "refused":
        d = Diagnosis("refused", reason="u is constant.", experiment=d.experiment, record=d.record)
    return replace(d, **changes)


def bare(verdict="found"):
    """Without plots, which take most of the time."""
    return diagnosis(verdict, traces=None, ranking=())


# --- text --------------------------------------------------------------------------------


@pytest.mark.parametrize("verdict", VERDICTS)
def test_text_starts_with_the_verdict_and_fits_80_columns(verdict):
    said = report.text(diagnosis(verdict))
    assert said.startswith(verdict)
    assert max(map(len, said.splitlines())) <= 80
    assert "nan" not in said.lower() and "None" not in said


def test_text_says_what_was_found_and_how_much_it_helps():
    said = report.text(diagnosis())
    assert said.startswith("found: torque_ripple\n")
    assert "r_e = A sin(N theta + phi)" in said
    assert re.search(r"amplitude +0\.0501 +0\.0489 to 0\.0513 +N m", said)
    assert re.search(r"w, restarted +rad/s +- +0\.210 +0\.0210 +0\.0101 +90 %", said)
    assert re.search(r"torque +mN m +40\.0 +36\.0 +2\.20 +- +94 %", said)
    assert re.search(r"J +0\.0024\d* +0\.0022\d* +0\.00213\d* to 0\.00227\d* +kg m2", said)
    assert "periodic_disturbance (r_e = A sin(2 pi f t + phi))" in " ".join(said.split())


def test_text_of_the_other_verdicts():
    assert "Explain it as well: periodic_disturbance" in report.text(diagnosis("ambiguous"))
    assert "Record slow moves both ways." in report.text(diagnosis("ambiguous"))
    assert "hangs on theta" in report.text(diagnosis("unexplained")).splitlines()[1]
    assert "u is constant." in report.text(diagnosis("refused"))
    adequate = report.text(diagnosis("adequate"))
    assert "90 %" not in adequate and "Missing" not in adequate


def test_errors_of_a_linear_drive_are_shown_in_millimetres():
    error = diagnosis().error | {"signal": "theta", "unit": "m", "refitted": 6.74e-3}
    small = {"declared": 9.1e-3, "augmented": 2.64e-3, "noise_floor": 1e-6}
    free = diagnosis().free_error | {"signal": "theta", "unit": "m", "augmented": 3.16e-3}
    said = report.text(diagnosis(error=error | small, free_error=free))
    assert max(map(len, said.splitlines())) <= 80
    assert re.search(r"theta, restarted +mm +9\.10 +6\.74 +2\.64 +0\.00100", said)


def test_an_identification_is_rendered_by_what_it_has():
    class Identified:
        estimates = {"J": Estimate(0.0022, "kg m2", (0.0021, 0.0023))}
        error = diagnosis().error
        model = Model.of(table1())
        messages = ("all well",)

    said = report.text(Identified())
    assert said.startswith("identified") and "0.0021" in said and "all well" in said
    assert "identified" in report.html(Identified())


@given(st.floats(-1e5, 1e5), st.floats(1e-5, 1e4))
@example(2.388e-6, 1.2e-8)
def test_interval_text_keeps_the_interval(middle, width):
    low, high = middle - width / 2, middle + width / 2
    value, text = wording._with_interval(Estimate(middle, "1", (low, high)))
    shown = [float(x) for x in (value, *text.split(" to "))]
    assert np.allclose(shown, [middle, low, high], rtol=0, atol=0.06 * width)


@given(st.lists(st.floats(0, 1e3), min_size=1), st.sampled_from(["m", "rad/s", "N m", "1"]))
def test_readable_units_change_no_value(values, unit):
    factor, shown = wording.readable(values, unit)
    assert {1.0: "", 1e3: "m", 1e6: "u"}[factor] + unit == shown
    assert factor == 1.0 or max(values) * factor >= 0.1 or max(values) < 1e-7


# --- HTML --------------------------------------------------------------------------------

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Page(HTMLParser):
    """Open tags as a stack, so that a tag left open or closed twice is noticed."""

    def __init__(self, text):
        super().__init__()
        self.stack, self.tags, self.attributes, self.said = [], [], [], []
        self.feed(text)
        self.close()
        assert not self.stack

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.stack.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag

    def handle_data(self, data):
        self.said.append(data)


@pytest.mark.parametrize("verdict", VERDICTS)
def test_page_is_whole_self_contained_and_safe(verdict):
    d = diagnosis(verdict)
    page = Page(report.html(d))
    assert "script" not in page.tags and "link" not in page.tags and "iframe" not in page.tags
    addresses = [v for k, v in page.attributes if k in ("src", "href", "xlink:href", "action")]
    assert all(v.startswith(("#", "data:image/png;base64,")) for v in addresses)
    style = "".join(s for s in page.said)
    assert "url(" not in style.replace("url(#", "") and "@import" not in style
    assert HOSTILE in style and page.tags.count("figure") == len(plot.available(d))
    ids = [v for k, v in page.attributes if k == "id"]
    assert len(ids) == len(set(ids))


def test_fragment_carries_the_same_content_and_notebooks_find_it():
    d = diagnosis()
    fragment = Page(d._repr_html_())
    assert "html" not in fragment.tags and fragment.tags.count("figure") == 4
    assert str(d) == report.text(d)


def test_no_figure_holds_a_coordinate_that_is_no_number():
    for _, svg in plot.drawings(diagnosis()):
        paths = re.findall(r'\bd="([^"]*)"', svg)
        assert paths and not any("nan" in p.lower() or "inf" in p.lower() for p in paths)


# --- files -------------------------------------------------------------------------------


def content(folder):
    return {p.name: p.read_bytes() for p in folder.iterdir()}


def test_write_makes_three_files_that_agree(tmp_path):
    d, folder = bare(), tmp_path / "a" / "b"
    paths = report.write(d, folder)
    assert [p.name for p in paths] == sorted(content(folder), key=list(report.FILES).index)

    def refuse(word):
        raise AssertionError(word)

    document = json.loads((folder / "report.json").read_text(), parse_constant=refuse)
    assert document["verdict"] == "found" and document["free_error"]["declared"] is None
    assert read_model(folder / "model.toml").values() == d.model.values()
    assert list(tmp_path.iterdir()) == [tmp_path / "a"]


def test_write_replaces_its_own_files_and_no_others(tmp_path):
    (tmp_path / "log.csv").write_text("mine")
    report.write(bare("found"), tmp_path)
    report.write(bare("adequate"), tmp_path)
    assert set(content(tmp_path)) == {"log.csv", *report.FILES}
    assert json.loads((tmp_path / "report.json").read_text())["verdict"] == "adequate"


@pytest.mark.parametrize("fails", range(6))
def test_a_failure_half_way_leaves_everything_as_it_was(tmp_path, monkeypatch, fails):
    report.write(bare("found"), tmp_path)
    before, calls, move = content(tmp_path), [], atomic.os.replace

    def breaking(source, target):
        calls.append(source)
        if len(calls) == fails + 1:
            raise OSError(28, "No space left on device")
        move(source, target)

    monkeypatch.setattr(atomic.os, "replace", breaking)
    with pytest.raises(InputError, match="No space left"):
        report.write(bare("adequate"), tmp_path)
    assert content(tmp_path) == before


@pytest.mark.parametrize("method", ["write_text", "rename"])
def test_a_failure_leaves_no_new_folder(tmp_path, monkeypatch, method):
    def broken(*_, **__):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(atomic.Path, method, broken)
    with pytest.raises(InputError, match="Read-only"):
        report.write(bare(), tmp_path / "new" / "folder")
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_where_nothing_can_be(tmp_path):
    with pytest.raises(InputError, match="no report"):
        report.write(bare("refused"), tmp_path / "out")
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match="not a folder"):
            report.check_folder(folder)
        with pytest.raises(InputError, match="cannot be written"):
            report.write(bare(), folder)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


# --- plots -------------------------------------------------------------------------------


def test_overview_draws_every_plot_without_pyplot():
    figure = plot.overview(diagnosis())
    assert isinstance(figure, Figure) and len(figure.axes) == 4
    assert not plt.get_fignums()
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_overview_draws_into_the_axes_given():
    ax = Figure().subplots()
    assert diagnosis().plot(ax) is ax and len(ax.lines) == 3


def test_nothing_to_plot_is_said():
    for d in (diagnosis("refused"), Diagnosis("adequate")):
        assert plot.available(d) == []
        with pytest.raises(InputError, match="nothing to plot"):
            d.plot()
    for draw in (plot.motion, plot.error, plot.torque, plot.ranking):
        with pytest.raises(InputError):
            draw(diagnosis("refused"))


def test_missing_traces_leave_only_their_own_plot_out():
    tr, nan = traces(), np.full(12000, np.nan)
    assert plot.available(diagnosis(traces=None)) == ["ranking"]
    assert plot.available(diagnosis(traces=replace(tr, simulated={}))) == ["torque", "ranking"]
    blank = replace(tr, simulated={"refitted": nan}, residual={"refitted": nan})
    assert plot.available(diagnosis(traces=blank, ranking=())) == []


def test_the_stretch_shown_is_the_worst_held_out_one():
    tr = traces()
    cut = views.stretch(tr)
    assert tr.t[cut.stop - 1] - tr.t[cut.start] == pytest.approx(views.STRETCH, abs=0.01)
    assert tr.t[cut.start] <= 6.3 and tr.t[cut.stop - 1] >= 7.3
    ax = plot.motion(diagnosis())
    low, high = ax.get_xlim()
    assert low <= 6.3 and high >= 7.3 and ax.get_ylabel() == "w [rad/s]"


def test_error_over_time_agrees_with_the_error_itself():
    tr = traces()
    error = tr.measured - tr.simulated["refitted"]
    edges, rms = views.rms_over_time(tr.t, error)
    share, _ = np.histogram(tr.t[tr.held_out], edges)
    total = np.sqrt(np.nansum(share * rms**2) / tr.held_out.sum())
    assert total == pytest.approx(np.sqrt(np.nanmean(error**2)), rel=1e-12)
    assert np.isnan(rms[edges[1:] < 1.9]).all()


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(-9, 9)), min_size=1), st.integers(1, 9))
def test_bin_means_add_up_to_the_mean(points, bins):
    x, y = np.array(points).T
    edges = np.linspace(0, 1, bins + 1)
    centres, mean = views.binned(x, y, edges, least=1)
    count, _ = np.histogram(x, edges)
    assert np.nansum(mean * count) == pytest.approx(y.sum(), abs=1e-9)
    assert np.array_equal(np.isnan(mean), count == 0) and len(centres) == bins


def test_residual_of_a_ripple_is_shown_over_one_turn():
    view = views.residual(diagnosis())
    assert view.label == "theta modulo one turn [rad]" and view.held_out
    centres, mean = views.binned(view.x, view.before, np.linspace(0, 2 * np.pi, 65))
    good = np.isfinite(mean)
    assert np.allclose(mean[good], A * np.sin(N * centres[good] + PHI), atol=0.012)
    assert np.sqrt(np.mean(view.after**2)) < 0.011


@pytest.mark.parametrize(
    ("finding", "label"),
    [
        (effect("torque_ripple", harmonic=48.0), "theta modulo 0.1309 rad [rad]"),
        (effect("gravity", amplitude=0.1), "theta modulo one turn [rad]"),
        (effect("return_spring", stiffness=0.1), "theta [rad]"),
        (effect("quadratic_drag", coefficient=0.1), "w [rad/s]"),
        (effect("friction_step", ratio=0.1, time=5.0), "t [s]"),
        (effect("periodic_disturbance", frequency=4.0), "t modulo 0.25 s [s]"),
        (effect("input_delay", delay=0.002), "du/dt [N m/s]"),
        (effect("someones_own"), "theta modulo one turn [rad]"),
    ],
)
def test_residual_is_shown_against_the_signal_that_explains_it(finding, label):
    assert views.residual(diagnosis(effects=(finding,))).label == label


def test_a_change_of_friction_level_is_shown_with_the_sign_taken_out():
    tr = traces()
    step = 0.03 * (tr.t > 6.0) * np.sign(tr.signals["w"])
    tr = replace(tr, residual={"refitted": step, "augmented": 0.0 * step})
    d = diagnosis(effects=(effect("friction_step", ratio=0.1, time=6.0),), traces=tr)
    view = views.residual(d)
    assert view.level and np.allclose(view.before, 0.03 * (view.x > 6.0))
    assert "x sign(w)" in plot.torque(d).get_ylabel()


def test_linear_drives_have_linear_labels():
    linear = replace(Model.of(table1()), motion="linear")
    found = effect("torque_ripple", harmonic=2 * np.pi / 0.5)
    ax = plot.torque(diagnosis(model=linear, effects=(found,)))
    assert ax.get_ylabel() == "residual force [N]"
    assert ax.get_xlabel() == "theta modulo 0.5 m [m]"


def test_residual_of_an_unexplained_record_hangs_on_what_was_named():
    view = views.residual(diagnosis("unexplained"))
    assert view.label.startswith("theta") and view.after is None
    d = diagnosis("unexplained", depends_on=("t",), effects=(effect("quadratic_drag"),))
    assert views.residual(d).label == "t [s]"
    assert "quadratic_drag explains a part" in " ".join(report.text(d).split())


def test_without_held_out_samples_the_whole_record_is_shown():
    tr = replace(traces(), held_out=np.zeros(12000, bool))
    view = views.residual(diagnosis(traces=tr))
    assert not view.held_out and len(view.x) == 12000


@pytest.mark.parametrize("name", members("effect"))
def test_every_effect_of_the_catalogue_can_be_reported(name):
    values = members("effect")[name].defaults()
    d = diagnosis(effects=(effect(name, **values),))
    assert members("effect")[name].equation.rstrip(".") in report.text(d)
    assert plot.torque(d).get_xlabel()


def test_ranking_stays_readable_when_one_dominates():
    ax = plot.ranking(diagnosis())
    assert [label.get_text() for label in ax.get_yticklabels()][0] == "torque_ripple"
    assert ax.get_xscale() == "symlog"
    even = tuple(Candidate(f"c{i}", 10.0 + i, 0.1) for i in range(30))
    ax = plot.ranking(diagnosis(ranking=even))
    assert ax.get_xscale() == "linear" and len(ax.patches) == 10

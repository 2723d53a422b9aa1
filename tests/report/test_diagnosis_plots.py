"""Plots of made-up diagnoses."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import report
from lugrectl.blocks.block import members
from lugrectl.blocks.model import Model, table1
from lugrectl.core.errors import InputError
from lugrectl.diagnosis.result import Diagnosis
from lugrectl.report import canvas, diagnosis_plots

from ..cases.made_up import PHI, A, N, diagnosis, effect, traces


def names(d):
    return [figure.name for figure in diagnosis_plots.figures(d)]


# --- plots -------------------------------------------------------------------------------


def test_nothing_to_plot_is_said():
    for d in (diagnosis("refused"), Diagnosis("adequate")):
        assert names(d) == []
        with pytest.raises(InputError, match="nothing to plot"):
            d.plot()
    for draw in (diagnosis_plots.motion, diagnosis_plots.torque):
        with pytest.raises(InputError):
            draw(diagnosis("refused"))


def test_missing_traces_leave_only_their_own_plot_out():
    tr, nan = traces(), np.full(12000, np.nan)
    assert names(diagnosis(traces=None)) == ["budget"]
    assert names(diagnosis(traces=replace(tr, simulated={}))) == [
        "budget",
        "torque",
    ]
    blank = replace(tr, simulated={"refitted": nan}, residual={"refitted": nan})
    assert names(diagnosis(traces=blank, comparison=None)) == []


def test_the_stretch_shown_is_the_worst_held_out_one():
    ax = diagnosis_plots.motion(diagnosis())
    low, high = ax.get_xlim()
    assert low <= 6.3 and high >= 7.3 and ax.get_ylabel() == "w [rad/s]"


def test_residual_of_a_ripple_is_shown_over_one_turn():
    view = diagnosis_plots.residual(diagnosis())
    assert view.label == "theta modulo one turn [rad]" and view.held_out
    centres, mean = canvas.binned(view.x, view.before, np.linspace(0, 2 * np.pi, 65))
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
        (effect("input_delay", delay=0.002), "u [N m]"),
        (effect("someones_own"), "theta modulo one turn [rad]"),
    ],
)
def test_residual_is_shown_against_the_signal_that_explains_it(finding, label):
    assert diagnosis_plots.residual(diagnosis(effects=(finding,))).label == label


def test_a_change_of_friction_level_is_shown_with_the_sign_taken_out():
    tr = traces()
    step = 0.03 * (tr.t > 6.0) * np.sign(tr.signals["w"])
    tr = replace(tr, residual={"refitted": step, "augmented": 0.0 * step})
    d = diagnosis(effects=(effect("friction_step", ratio=0.1, time=6.0),), traces=tr)
    view = diagnosis_plots.residual(d)
    assert view.signed and np.allclose(view.before, 0.03 * (view.x > 6.0))
    assert "x sign(w)" in diagnosis_plots.torque(d).get_ylabel()


def test_the_budget_has_a_bar_for_each_term_with_its_share():
    d = diagnosis()
    ax = diagnosis_plots.bars(d)
    names = [label.get_text() for label in ax.get_yticklabels()][::-1]
    assert names == ["coulomb", "viscous", "torque_ripple", "not explained", "of it sensor noise"]
    assert [bar.get_width() for bar in ax.patches][::-1][2] == pytest.approx(11.0)
    assert ax.texts[2].get_text() == "11 %"


def test_linear_drives_have_linear_labels():
    linear = replace(Model.of(table1()), motion="linear")
    found = effect("torque_ripple", harmonic=2 * np.pi / 0.5)
    ax = diagnosis_plots.torque(diagnosis(model=linear, effects=(found,)))
    assert ax.get_ylabel() == "residual force [mN]"
    assert ax.get_xlabel() == "theta modulo 0.5 m [m]"


def test_residual_of_an_unexplained_record_hangs_on_what_was_named():
    view = diagnosis_plots.residual(diagnosis("unexplained"))
    assert view.label.startswith("theta") and view.after is None
    d = diagnosis("unexplained", depends_on=("t",), effects=(effect("quadratic_drag"),))
    assert diagnosis_plots.residual(d).label == "t [s]"
    assert "quadratic_drag explain a part" in " ".join(report.text(d).split())


def test_without_held_out_samples_the_whole_record_is_shown():
    tr = replace(traces(), held_out=np.zeros(12000, bool))
    view = diagnosis_plots.residual(diagnosis(traces=tr))
    assert not view.held_out and len(view.x) == 12000


@pytest.mark.parametrize("name", members("effect"))
def test_every_effect_of_the_catalogue_can_be_reported(name):
    values = members("effect")[name].defaults()
    d = diagnosis(effects=(effect(name, **values),))
    assert members("effect")[name].equation.rstrip(".") in report.text(d)
    assert diagnosis_plots.torque(d).get_xlabel()


def test_small_residuals_are_drawn_with_the_prefix_of_the_table():
    made = diagnosis().traces
    small = replace(made, residual={k: 1e-3 * v for k, v in made.residual.items()})
    axes = [diagnosis_plots.torque(diagnosis(traces=x)) for x in (made, small)]
    assert [ax.get_ylabel() for ax in axes] == ["residual torque [mN m]", "residual torque [uN m]"]
    big, little = (ax.get_ylim() for ax in axes)
    assert little == pytest.approx(big)


def test_a_residual_over_one_turn_shows_all_of_it_and_each_ripple_in_fine_bins():
    view = diagnosis_plots.residual(diagnosis())
    edges = view.edges()
    assert (edges[0], edges[-1]) == (0.0, pytest.approx(2 * np.pi))
    assert len(edges) - 1 == min(20 * N, len(view.x) // 20) >= 60
    _, mean = canvas.binned(view.x, view.before, edges)
    assert np.nanmax(mean) > 0.95 * A
    assert diagnosis_plots.torque(diagnosis()).get_xlim() == pytest.approx((0.0, 2 * np.pi))

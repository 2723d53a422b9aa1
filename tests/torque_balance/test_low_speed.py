"""What few runs at steady speed leave open: the fall of friction at low speed, and any test."""

import numpy as np
import pytest

import lugrectl as lg

FC, FS, FV, VS = 0.3, 0.4, 0.02, 2.0
STRIBECK = lg.Model.of(friction="stribeck")


def steady(speeds, fall=0.0, drag=0.0, seed=0, dt=5e-3, Fv=FV):
    """Runs at these speeds in both directions, each with a scatter of its own."""
    chance, runs = np.random.default_rng(seed), []
    for w in [*speeds, *(-w for w in speeds)]:
        level = FC + fall * np.exp(-((w / VS) ** 2))
        u = level * np.sign(w) + Fv * w + drag * w * abs(w) + 1e-3 * chance.standard_normal()
        noise = 1e-3 * chance.standard_normal((2, 200))
        runs.append({"t": dt * np.arange(200), "w": w + noise[0], "u": u + noise[1]})
    return runs


def test_a_fall_below_the_slowest_run_stays_open():
    found = lg.diagnose(steady(np.linspace(8.0, 30.0, 5), fall=FS - FC), STRIBECK)
    assert found.verdict == "adequate"
    assert not any(k in found.estimates and found.estimates[k].ci95 for k in ("Fs", "vs"))
    assert "slower than 8 rad/s" in found.experiment
    low, high = found.estimates["Fc"].ci95
    assert low < FC < high


def test_a_declared_fall_that_no_run_shows_stays_as_declared():
    model = lg.Model.of(friction="stribeck", Fc=FC, Fs=FS, Fv=FV, vs=VS)
    found = lg.identify(steady(np.linspace(8.0, 30.0, 5), fall=FS - FC), model)
    assert found.model.friction.values["Fs"] == FS and found.model.friction.values["vs"] == VS


def test_a_value_that_was_guessed_may_be_0_without_the_fall_too():
    found = lg.identify(steady(np.linspace(8.0, 30.0, 5), Fv=0.0), STRIBECK)
    assert found.estimates["Fv"].value < 1e-3
    assert not any("limit of the range" in said for said in found.messages)


@pytest.mark.parametrize("many", [4, 5, 6])
def test_few_points_have_finite_intervals(many):
    """Where Akaike's criterion is infinite for both laws neither is preferred."""
    model = STRIBECK.with_effect("constant_torque", {"torque": 0.01})
    runs = steady(np.linspace(8.0, 30.0, 3), fall=FS - FC)
    found = lg.identify([runs[i] for i in (0, 5, 3, 2, 1, 4)[:many]], model)
    ends = [end for e in found.estimates.values() for end in e.ci95 or ()]
    assert ends and np.all(np.isfinite(ends))


def test_means_need_no_fast_log(tmp_path):
    """A run at steady speed may be logged at 3 Hz, with or without a unit of t in its header."""
    for i, run in enumerate(steady(np.linspace(2.0, 30.0, 5), dt=0.3)):
        table = np.c_[run["t"], run["u"], run["w"]]
        np.savetxt(tmp_path / f"run{i}.csv", table, "%.9g", ",", header="t,u,w", comments="")
    found = lg.balance(sorted(map(str, tmp_path.glob("*.csv"))))
    assert found.is_map and found.parameters["Fc"].may_be(FC)


def test_drag_is_named_beside_a_law_whose_fall_could_imitate_it():
    found = lg.diagnose(steady(np.geomspace(1.5, 30.0, 6), drag=4e-4), STRIBECK)
    assert [e.name for e in found.effects] == ["quadratic_drag"]
    assert abs(found.estimates["Fc"].value - FC) < 0.01


def test_without_its_fall_the_law_has_any_coulomb_friction():
    """Beside a drag that is large, a fit without the drag has little of it, and a start of Fs."""
    runs = steady(np.geomspace(1.5, 40.0, 6), drag=8e-4)
    found = lg.diagnose(runs, lg.Model.of(J=0.005, friction="lugre"))
    assert [e.name for e in found.effects] == ["quadratic_drag"]
    assert found.effects[0].parameters["coefficient"].value == pytest.approx(8e-4, rel=0.02)
    assert found.estimates["Fc"].value == pytest.approx(FC, rel=0.02)
    assert "Fs" not in found.estimates


def test_as_many_values_as_runs_test_nothing():
    runs = steady([2.0, 8.0, 30.0])[:4]
    found = lg.diagnose(runs, STRIBECK)
    assert found.verdict == "refused" and "nothing can be tested" in found.reason
    assert "more speeds" in found.experiment and found.plain.is_map

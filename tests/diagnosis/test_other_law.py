"""A declared friction law that cannot be that of the drive is not adequate."""

import numpy as np
import pytest

import lugrectl as lg

DT = 2e-3


@pytest.fixture(scope="module")
def log():
    """J 0.002, Coulomb friction of 0.3 N m, viscous of 0.02."""
    t = np.arange(0.0, 12.0, DT)
    w = 8.0 * np.sin(0.8 * np.pi * t) + 3.0 * np.sin(2.2 * np.pi * t + 1.0)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    u = 0.002 * np.gradient(w, DT) + 0.3 * np.tanh(w / 0.02) + 0.02 * w + noise
    return {"t": t, "u": u, "theta": np.cumsum(w) * DT}


@pytest.fixture
def half():
    """A law in which Fc is half of Coulomb friction and Fv a quadratic coefficient."""

    @lg.block("friction", out="F")
    def half(w, Fc=lg.P(0.1, "N m", 0), Fv=lg.P(0.001, "N m s2/rad2", 0)):
        return 2.0 * Fc * np.tanh(100.0 * w) + Fv * w * abs(w)

    return half


def test_a_law_without_coulomb_friction_is_not_adequate_where_there_is_some(log):
    found = lg.diagnose(log, lg.Model.of(friction="viscous"))
    assert found.verdict == "unexplained" and found.depends_on == ("w",)
    assert "'viscous' has no Coulomb friction, and the log shows 0.3 N m" in found.messages[0]


def test_an_own_law_without_viscous_friction_is_fitted_and_what_it_lacks_is_said(log):
    @lg.block("friction", out="F")
    def smooth(w, Fc=lg.P(0.1, "N m", 0)):
        return Fc * np.tanh(100.0 * w)

    fitted = lg.identify(log, lg.Model.of(friction="smooth"))
    assert fitted.estimates["Fc"].value == pytest.approx(0.3, rel=0.02)
    said = "'smooth' has no viscous friction, and the log shows 0.02 N m s/rad of it"
    assert said in fitted.messages[0]
    found = lg.diagnose(log, lg.Model.of(friction="smooth"))
    assert found.verdict == "unexplained" and said in found.messages[0]


def test_values_of_the_balance_are_not_those_of_an_own_law_of_the_same_names(log, half):
    found = lg.diagnose(log, lg.Model.of(friction="half"))
    assert found.verdict == "unexplained"
    assert "'half' does not fit this log" in found.messages[0]
    fitted = lg.identify(log, lg.Model.of(friction="half"))
    assert "'half' does not fit this log" in " ".join(fitted.messages)
    assert fitted.estimates["J"].value == pytest.approx(0.002, rel=0.02)

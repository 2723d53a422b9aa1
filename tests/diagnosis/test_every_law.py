"""Each friction law of the package is identified from a log of a drive that has it."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.small_answers import STEP

DT, FINE = 2e-3, 20
ALWAYS, QUICK = "lugre", ("viscous", "stribeck", "dahl", "maxwell_slip", "bouc_wen")
SAMPLED = (pytest.mark.slow, pytest.mark.sample)


def marks(law):
    return () if law == ALWAYS else SAMPLED if law in QUICK else pytest.mark.slow


KNOWN = {
    "J": 0.002, "Fc": 0.12, "Fs": 0.16, "Fv": 0.02, "vs": 0.1, "sigma0": 60.0, "sigma1": 0.1,
}  # fmt: skip


def drive(law):
    model = lg.Model.of(J=KNOWN["J"], friction=law)
    return model.with_values({k: KNOWN.get(k, p.value) for k, p in model.declarations().items()})


def log(model):
    """16 s of a torque that is held, from rest."""
    t = DT * np.arange(8000)
    u = 0.5 * np.sin(np.pi * t) * (1.0 + 0.3 * np.sin(t)) + 0.12 * np.sin(4.6 * np.pi * t + 1.0)
    held, fine = np.repeat(u, FINE), DT / FINE * np.arange(FINE * len(u))
    made = lg.simulate(lg.plant(model), fine, np.array([held, 0.0 * held]))
    theta = made.outputs[list(made.output_labels).index("theta")][::FINE]
    return {"t": t, "u": u, "theta": STEP * np.round(theta / STEP)}


@pytest.mark.parametrize("law", [pytest.param(n, marks=marks(n)) for n in lg.laws().names])
def test_its_values_lie_in_their_intervals(law):
    model = drive(law)
    found, right = lg.identify(log(model), lg.Model.of(friction=law)), model.known()
    assert {"J", "Fv"} <= {row.name for row in found.parameters if row.low is not None}
    for row in found.parameters:
        if row.low is not None:
            margin = 0.01 * abs(right[row.name])
            assert row.low - margin <= right[row.name] <= row.high + margin, row
    if "sigma0" in right:
        assert found.model.known()["sigma0"] == pytest.approx(60.0, rel=0.05)
    assert found.error["refitted"] < 0.002


# A declared law that cannot be that of the drive is not adequate.


@pytest.fixture(scope="module")
def dry():
    """J 0.002, Coulomb friction of 0.3 N m, viscous of 0.02."""
    t = np.arange(0.0, 8.0, DT)
    w = 8.0 * np.sin(0.8 * np.pi * t) + 3.0 * np.sin(2.2 * np.pi * t + 1.0)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    u = 0.002 * np.gradient(w, DT) + 0.3 * np.tanh(w / 0.02) + 0.02 * w + noise
    return {"t": t, "u": u, "theta": np.cumsum(w) * DT}


@pytest.mark.slow
def test_a_law_without_coulomb_friction_is_not_adequate_where_there_is_some(dry):
    found = lg.diagnose(dry, lg.Model.of(friction="viscous"))
    assert found.verdict == "unexplained" and found.depends_on == ("w",)
    assert "'viscous' does not fit this log" in found.messages[0]


@pytest.mark.slow
def test_an_own_law_without_viscous_friction_is_fitted_and_what_it_lacks_is_said(dry):
    @lg.block("friction", out="F")
    def smooth(w, Fc=lg.P(0.1, "N m", 0)):
        return Fc * np.tanh(100.0 * w)

    fitted = lg.identify(dry, lg.Model.of(friction="smooth"))
    assert fitted.estimates["Fc"].value == pytest.approx(0.3, rel=0.02)
    said = "'smooth' does not fit this log"
    assert said in fitted.messages[0]
    found = lg.diagnose(dry, lg.Model.of(friction="smooth"))
    assert found.verdict == "unexplained" and said in found.messages[0]

"""Logs that are sound but unusual, or have one fault: their answers, by kind of fault."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.balance_drive import FC, FV, J, simulate
from ..cases.faulty_logs import columns, recorded

MODEL = lg.Model.of(friction="coulomb")
TRUE = {"J": J, "Fc": FC, "Fv": FV}
DT = 1e-3


def holds(parameters, within=0.03, **true):
    for key, x in (true or TRUE).items():
        found = parameters[key]
        assert found.value == pytest.approx(x, rel=within), key
        low, high = found.ci95
        assert low - 0.005 * x <= x <= high + 0.005 * x, key


def driven(u, noise=0.0, **start):
    """t, u and w of the drive at 1 kHz."""
    _, w = simulate(u, DT, **start)
    rng = np.random.default_rng(7)
    return {"t": DT * np.arange(len(u)), "u": u, "w": w + noise * rng.standard_normal(len(u))}


# ---- what channels have that is none of the drive


@pytest.mark.slow
def test_a_speed_alone_that_is_off_at_rest():
    above = -0.3
    log = columns("w", seconds=9.0)
    del log["theta"]
    log["w"] = log["w"] + above + 0.02 * np.random.default_rng(3).standard_normal(len(log["w"]))
    found = lg.diagnose(log, MODEL)
    assert (found.verdict, found.effects) == ("adequate", ())
    holds(found.plain.parameters)
    assert found.plain.parameters["w_offset"].value == pytest.approx(above, abs=0.05)
    assert found.error["refitted"] < 0.1  # the simulation is compared without the offset


# ---- what is certain all the same


def coasts(*speeds):
    """Runs without torque from these speeds."""
    return [driven(np.zeros(1500), noise=0.05, w0=w) for w in speeds]


@pytest.mark.slow
def test_coasting_with_a_declared_inertia():
    model = lg.Model.of(J=J, friction="coulomb")
    fit = lg.identify(coasts(60.0, 40.0, -50.0), model)
    holds(fit.estimates, Fc=FC, Fv=FV)


def test_a_run_at_rest_beside_others():
    log = columns()
    rest = {"t": 2.1e-3 * np.arange(300), "u": np.zeros(300), "theta": np.zeros(300)}
    holds(lg.balance([rest, log]).parameters)


def test_two_seconds():
    found = lg.diagnose(columns(seconds=2.0), MODEL)
    holds(found.plain.parameters, within=0.06)
    (said,) = [m for m in found.messages if "too short" in m]
    assert "Record at least 4.5 s" in said


@pytest.mark.slow
@pytest.mark.sample
def test_as_long_as_is_advised_is_enough():
    found = lg.diagnose(columns(seconds=4.6), MODEL)
    assert not any("too short" in m for m in found.messages)


# ---- effects of one's own


@pytest.mark.slow
def test_the_memory_of_an_own_effect_may_be_short():
    @lg.block("effect", out="d", acts="torque", states="c")
    def creeping_hose(w, c, k=lg.P(0.0, "N m/rad", 0, neutral=0.0), tau=lg.P(0.5, "s", 1e-2)):
        """d = k c, dc/dt = w - c/tau."""
        return k * c, w - c / tau

    _, u, _, _ = recorded(14.0)
    c = [0.0]

    def load(_, w):
        c[0] += 4e-4 * (w - c[0] / 0.4)
        return 0.06 * c[0]

    theta, w = simulate(u, 2e-3, load=load)
    log = {"t": 2e-3 * np.arange(len(u)), "u": u, "theta": theta, "w": w}
    model = lg.Model.of(J=J, friction="coulomb", effects=["creeping_hose"])
    fit = lg.identify(log, model)
    assert fit.parameters["creeping_hose.tau"].value == pytest.approx(0.4, rel=0.05)
    assert fit.parameters["creeping_hose.k"].value == pytest.approx(0.06, rel=0.1)

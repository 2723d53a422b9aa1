"""Gains from the estimated response, on the true drives: own sweeps, poles and simulations."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import control as ct
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.commissioning import tuning

from . import drives, loops

pytest.importorskip("numba")
RIGID = ct.tf([1.0], [0.01, 0.01])
HUNTS = lg.Model.of(J=0.0022, friction="stribeck", Fc=0.285, Fs=0.335, vs=0.01, Fv=0.018)
QUICK, SLOW = [303], [438, *range(502, 511)]  # 438: a resonance just beyond


def pid(found):
    """The gains as those of a PID on the position."""
    if found.structure != "PI":
        return found.kp, found.ki, found.kd
    return found.ki, 0.0, found.kp - found.ki / found.rate / 2


@pytest.fixture(scope="module")
def quick():
    return [(drives.draw(n), drives.answered(n)) for n in QUICK]


def judged(drive, found):
    """Whether the true drive is stable, its Ms, and the bandwidth over the best possible."""
    gains, kv = pid(found), (found.cascade or {}).get("kv", 0.0)
    best = loops.optimum(drive, found.structure, 1.6)
    own = loops.width(drive, found.structure, gains, kv, found.notch)
    assert found.bandwidth == pytest.approx(own, rel=0.05)
    peak = loops.sensitivity(drive, gains, found.notch)
    share = loops.bandwidth(gains, drive.inertia) / best
    return loops.stable(drive, gains, found.notch), peak, share


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["P-PI", "PID", "PI"])
def test_gains_of_a_log_on_the_true_drive(quick, structure):
    for drive, known in quick:
        stable, peak, share = judged(drive, lg.tune(known, structure, notch=False))
        assert stable and peak < 1.65 and 0.85 < share < 1.05, (drive.seed, peak, share)


@pytest.mark.slow
def test_a_notch_where_it_pays(quick):
    paid = 0
    for drive, known in quick:
        plain, found = (lg.tune(known, notch=on) for on in (False, True))
        stable, peak, share = judged(drive, found)
        assert stable and peak < 1.65
        speeds = (loops.bandwidth(pid(x), drive.inertia) for x in (found, plain))
        ratio = next(speeds) / next(speeds)
        assert (ratio > 1.1) == (found.notch is not None)
        if found.notch:
            paid += 1
            assert f"{100 * (ratio - 1):.0f} % faster" in found.messages[0]
    assert paid


@pytest.mark.slow
def test_ten_more_drives():
    """Gains are refused only where most of the response is not certain."""
    made, refused = [], []
    for n in SLOW:
        known = drives.answered(n)
        try:
            made.append(judged(drives.draw(n), lg.tune(known, notch=False)))
        except lg.Refused:
            refused.append(known.certain.mean())
    assert len(refused) <= 1 and all(share < 0.5 for share in refused)
    stable, peak, share = map(np.array, zip(*made, strict=True))
    assert stable.all() and np.mean(peak <= 2) >= 0.95 and np.quantile(share, 0.2) >= 0.85


@pytest.mark.slow
@pytest.mark.parametrize("structure, rate", [("P-PI", None), ("PID", 1000.0), ("PI", 1000.0)])
def test_a_system_and_a_model(structure, rate):
    model = lg.Model.of(J=0.01, friction="viscous", Fv=0.01)
    delay = lg.Model.of(model, effects=[{"name": "input_delay", "delay": 1e-3}])
    one = lg.tune(RIGID, structure, dead_time=1e-3, rate=rate)
    assert one.margins.Ms == pytest.approx(1.6, abs=1e-3) and bool(one.margins)
    for other in (lg.tune(model, structure, 1.6, 1e-3, rate), lg.tune(delay, structure, rate=rate)):
        assert other.kp == pytest.approx(one.kp, rel=1e-6)


def test_an_elastic_model_and_its_exact_sampling():
    drive = replace(drives.draw(303), Fv=0.0)
    A, B = drive.matrices()
    C = np.zeros((1, len(A)))
    C[0, 1] = 1.0
    system = ct.ss(A, B[:, :1], C, 0)
    found = lg.tune(system, "P-PI", dead_time=1 / drive.rate, rate=drive.rate)
    assert found.notch and loops.stable(drive, pid(found), found.notch)
    peak = loops.sensitivity(drive, pid(found), found.notch)
    assert peak == pytest.approx(found.margins.Ms, rel=2e-3)


def test_the_cascade_is_the_pid():
    found = lg.tune(RIGID, "P-PI", dead_time=1e-3)
    kv, kp, ki = found.cascade.values()
    assert (found.kp, found.ki, found.kd) == pytest.approx((kp * kv + ki, kv * ki, kp))
    assert found.Ti == kp / ki and kv <= ki / kp
    s = 2j
    assert found.controller(s) == pytest.approx((kp + ki / s) * (kv + s))
    step = found.step()
    assert step[1][-1] == pytest.approx(1.0, abs=0.02) and step[1].max() < 1.5


def test_where_nothing_is_certain_no_gain_reaches(quick):
    drive, known = quick[0]
    worse = replace(known, coherence=np.where(known.frequency > 60, 0.3, known.coherence))
    sure = known.mechanics
    blind = replace(worse, mechanics=None, low=known.low, high=known.high)
    found, full = lg.tune(blind, notch=False), lg.tune(known, notch=False)
    assert sure is not None and found.crossover < 60 and found.bandwidth < full.bandwidth
    assert any("are not certain" in m for m in found.messages)


def test_no_gains_of_a_log_that_friction_governs(quick):
    known = quick[0][1]
    with pytest.raises(lg.Refused, match="friction governs"):
        lg.tune(replace(known, governed=np.ones(len(known.frequency), bool)))


@pytest.mark.parametrize("outcome", ["rests", "hunts", "undecided"])
def test_gains_stay_where_hunting_is_not_decided(outcome, monkeypatch):
    """Only what hunts is made quieter."""
    cycles = lg.limit_cycles(HUNTS, kp=1.0, kd=0.2)
    first = SimpleNamespace(outcome=outcome, undecided=0, summary=cycles.summary)
    found = iter([first])
    monkeypatch.setattr(tuning, "limit_cycles", lambda *_, **__: next(found, cycles))
    plain = lg.tune(HUNTS, dead_time=1e-3)
    found = iter([first])
    quiet = lg.tune(HUNTS, dead_time=1e-3, hunting=False)
    assert (quiet.ki == plain.ki) == (outcome != "hunts")
    assert any("not decided" in m for m in quiet.messages) == (outcome == "undecided")


@pytest.mark.slow
@pytest.mark.parametrize("structure", ["P-PI", "PID", "PI"])
def test_gains_of_the_bandwidth_that_is_asked_for(structure):
    most = lg.tune(RIGID, structure, dead_time=1e-3, rate=1000.0)
    half = lg.tune(RIGID, structure, rate=1000.0, dead_time=1e-3, bandwidth=most.bandwidth / 2)
    assert half.bandwidth == pytest.approx(most.bandwidth / 2, rel=1e-3)
    assert half.worst < most.worst and half.crossover < most.crossover
    with pytest.raises(lg.Refused, match=r"out of reach: at Ms 1.6 this axis allows at most"):
        lg.tune(RIGID, structure, dead_time=1e-3, rate=1000.0, bandwidth=2 * most.bandwidth)


def test_the_bandwidth_of_a_slow_axis_with_dead_time_is_minus_3_db():
    """Not the crossing of an asymptote of |L|, five times as high, that is never reached."""
    g = lg.tune(ct.tf([1], [0.01, 0.1]), "PI", rate=1000, dead_time=10.0)
    w = np.geomspace(1e-3, 10, 40000)
    L = (g.kp + g.ki / (1j * w)) / (0.01j * w + 0.1) * np.exp(-10.0005j * w)
    true = w[np.flatnonzero(np.abs(L / (1 + L)) < 10 ** (-3 / 20))[0]]
    assert g.bandwidth == pytest.approx(true, rel=0.01)
    shown = [f"{x / (2 * np.pi):.3g} Hz" for x in (g.bandwidth, g.crossover)]
    assert all(x in repr(g).splitlines()[0] for x in shown)


@pytest.mark.parametrize(
    ("axis", "options", "said"),
    [
        (ct.tf([1.0], [0.01, 0.0]), {}, "give rate or dead_time"),
        (ct.tf([1.0], [0.01, -0.01]), {"dead_time": 1e-3}, "not stable"),
        (RIGID, {"structure": "PD"}, "structure must be one of"),
        (RIGID, {"Ms": 1.0}, "above 1"),
        (RIGID, {"dead_time": -1.0}, "negative"),
        (lg.Model.of(), {}, "J must be known"),
        (RIGID, {"dead_time": 1e-3, "hunting": False}, "give model="),
    ],
)
def test_what_cannot_be_tuned_is_said(axis, options, said):
    with pytest.raises((lg.InputError, lg.Refused), match=said):
        lg.tune(axis, **options)

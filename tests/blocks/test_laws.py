"""Friction laws: what each is known to do, in the engine, and in a model."""

import pickle

import control as ct
import numpy as np
import pytest
from scipy.integrate import solve_ivp, trapezoid

import lugrectl as lg
from lugrectl.blocks.model import model_toml
from lugrectl.engine import adaptive_run

from ..cases.laws import (
    CASES,
    DYNAMIC,
    FC,
    FS,
    FV,
    LAWS,
    S0,
    S1,
    TABLE1,
    VS,
    J,
    model_of,
    values_of,
)
from ..cases.wired import simulate

every_case = pytest.mark.parametrize("case", CASES)
every_dynamic = pytest.mark.parametrize("case", DYNAMIC)
UNCONDITIONAL = ("dahl", "maxwell_slip", "parallel_bristles", "bouc_wen")
P = lg.table1()
SECOND = np.linspace(0.0, 2.0, 2001)


@pytest.fixture(autouse=True)
def interpreted(monkeypatch):
    """No machine code: compiling takes longer than these runs."""
    monkeypatch.setattr(adaptive_run, "compiler", lambda: None)


@every_case
def test_at_rest_a_bristle_keeps_its_deflection_and_an_unbent_one_has_no_torque(case):
    """At w = 0 only a level that lags may change."""
    law, _ = CASES[case]
    made, values = values_of(case)
    assert not np.any(made(0.0, *np.zeros(len(made.states)), **values))
    _, *rates = made(0.0, *np.full(len(made.states), 3e-4), **values)
    moved = dict(zip(made.states, rates, strict=True))
    assert not any(v for k, v in moved.items() if k != "lost")
    if law not in ("viscous", "coulomb"):
        assert made.source and ("passiv" in LAWS[law].doc.lower() or not made.states)


@every_case
@pytest.mark.parametrize("speed", [0.003, -0.02, 4.0])
def test_steady_sliding_is_the_static_map(case, speed):
    """At the deflection of steady sliding the rates are 0, F = g(w) + Fv w; others go there."""
    law, own = CASES[case]
    made, values = values_of(case)
    way = np.sign(speed)
    peak = np.exp(-(abs(speed / VS) ** own.get("delta", 2.0))) if "Fs" in values else 0.0
    h = FC + (FS - FC) * peak
    F, *rates = made(speed, *steady(made, h, 1.0 - peak, way), **values)
    assert F == pytest.approx((0.0 if law == "viscous" else h * way) + FV * speed, rel=1e-10)
    assert np.abs(rates) == pytest.approx(0.0, abs=1e-11 * abs(speed))
    for part in (0.5, 0.9, 1.1):
        _, *rates = made(speed, *steady(made, part * h, 1.0 - peak, way), **values)
        moved = [way * v for k, v in zip(made.states, rates, strict=True) if k != "lost"]
        assert all(v > 0.0 if part < 1.0 else v < 0.0 for v in moved)


def steady(made, h, lost, way):
    """The states when the drive slides at the level h."""
    if "lost" in made.states:
        return way * h / S0, lost
    if made.states == ("z",):
        return (way * h / S0,)
    return [way * nu * h / (k * S0) for k, nu in made.function.parts] if made.states else ()


@every_dynamic
def test_what_is_called_passive_never_gives_out_more_than_it_stores(case):
    """Energy taken in from rest is never negative: for all laws where Fv is large enough."""
    law, own = CASES[case]
    made, values = values_of(case)
    if law not in UNCONDITIONAL:
        power = values.get("n", 1.0)
        values["Fv"] = S1 * ((FS / FC) ** power - 1.0)
    random = np.random.default_rng(0)
    a, f = random.uniform(0.01, 0.3, 6), random.uniform(0.5, 12.0, 6)

    def rates(s, x):
        w = np.sum(a * np.sin(2.0 * np.pi * f * s))
        F, *dx = made(w, *x[:-1], **values)
        return np.array([*dx, F * w])

    x0 = np.zeros(len(made.states) + 1)
    run = solve_ivp(rates, (0, 0.3), x0, method="LSODA", rtol=1e-8, atol=1e-12, max_step=4e-3)
    assert run.y[-1].min() >= -1e-9


LOOPS = [
    ("dahl", {}, ".28607 .27476 .010186 .26194"),
    ("lugre", {"vd": VS}, ".28607 .27647 .010169 .26234"),
    ("two_state", {}, ".28613 .28517 .010189 .26888"),
    ("maxwell_slip", {}, ".28613 .27980 .008676 .24560"),
    ("parallel_bristles", {}, ".27505 .28318 .008884 .24509"),
    ("leuven", {}, ".2501 .2758 .00849 .2337"),
    ("bouc_wen", {"beta": 1.0, "n": 3.0}, ".28613 .27493 .010302 .26650"),
]


@pytest.mark.parametrize(("law", "own", "known"), LOOPS)
def test_the_loop_of_a_swing_has_the_known_figures(law, own, known):
    """Computed elsewhere from the same equations, to one unit of the last digit."""
    t = np.linspace(0.0, 2.0, 4001)
    w = 0.02 * np.pi * np.cos(2.0 * np.pi * t)
    F = lg.simulate(lg.friction(law, **own), t, w, rtol=1e-8).outputs
    again = slice(2000, None)
    area, size = trapezoid((F * w)[again], t[again]), np.sqrt(np.mean(F[again][:-1] ** 2))
    for value, text in zip((F[2000], F[2520], area, size), known.split(), strict=True):
        digits = len(text) - 1
        assert round(float(value), digits) == pytest.approx(float(text), abs=1.01 * 10.0**-digits)


def test_dahl_with_an_exponent_has_its_closed_form():
    """n = 2 from rest: 1 - F/Fc = 1/(1 + sigma0 x/Fc)."""
    x = np.linspace(0.0, 0.02, 41)
    F = lg.simulate(lg.friction("dahl", Fv=0.0, n=2.0), x, np.ones(41), rtol=1e-10).outputs
    np.testing.assert_allclose(F, FC * (1.0 - 1.0 / (1.0 + S0 * x / FC)), atol=1e-9)


def test_dahl_and_bouc_wen_are_lugre_without_damping_and_peak():
    random = np.random.default_rng(1)
    w, z = random.normal(size=(2, 50)) * [[0.5], [5e-4]]
    plain = lg.Model.of(friction="lugre").friction.block
    lugre = plain(w, z, sigma0=S0, sigma1=0.0, Fc=FC, Fs=FC, Fv=FV, vs=VS)
    dahl = LAWS["dahl"](w, z, sigma0=S0, Fc=FC, Fv=FV, n=1.0)
    bouc_wen = LAWS["bouc_wen"](w, z, sigma0=S0, Fc=FC, Fv=FV, beta=1.0, n=1.0)
    np.testing.assert_allclose(dahl, lugre, rtol=1e-12)
    np.testing.assert_allclose(bouc_wen, lugre, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("law", "drift", "within"),
    [
        ("lugre", 11.5, 0.06),
        ("elastoplastic", 0.0, 0.06),
        ("maxwell_slip", 0.0, 0.005),  # what its smooth edge leaves
    ],
)
def test_under_a_small_oscillating_torque_only_an_elastic_zone_holds(law, drift, within):
    """0.15 + 0.04 sin(2 pi 20 t) N m, below breakaway: mrad/s from the second second on."""
    u = 0.15 + 0.04 * np.sin(40.0 * np.pi * SECOND)
    theta = lg.simulate(lg.plant(model_of(law)), SECOND, [u, 0.0 * u]).outputs[0]
    assert 1e3 * (theta[2000] - theta[1000]) == pytest.approx(drift, abs=within)


def return_map(theta, N=4, Fc=FC):
    """Maxwell slip, exact for any motion: each spring is moved, then held at its limit."""
    k = np.array([2.0 * (N + 1 - i) / (N * (N + 1)) for i in range(1, N + 1)]) * S0
    limit = np.array([2.0 * i / (N * (N + 1)) for i in range(1, N + 1)]) * Fc
    F, kept = np.zeros(N), []
    for step in np.diff(theta, prepend=theta[0]):
        F = np.clip(F + k * step, -limit, limit)
        kept.append(F.sum())
    return np.array(kept)


def test_maxwell_slip_is_its_return_map():
    t = np.linspace(0.0, 2.0, 4001)
    theta = 3e-3 * np.sin(2.0 * np.pi * t) + 1e-3 * np.sin(14.0 * np.pi * t)
    w = np.gradient(theta, t)
    moved = np.concatenate([[0.0], np.cumsum(0.5 * (w[1:] + w[:-1]) * np.diff(t))])
    made = lg.friction("maxwell_slip", Fv=0.0)
    F = lg.simulate(made, t, w, rtol=1e-8).outputs
    np.testing.assert_allclose(F, return_map(moved), atol=2e-4 * FC)


NESTED = {"maxwell_slip": (-1e-4, 1e-4), "elastoplastic": (-2e-3, 1e-4)}

NESTED |= {"lugre": (-0.08, -0.04), "dahl": (-0.08, -0.04)}


@pytest.mark.parametrize("law", NESTED)
def test_a_small_loop_inside_a_large_one_closes_only_with_a_memory_of_turns(law):
    """F at 0.9 mrad after an excursion to 0.5 mrad, minus F before it, N m."""
    t = np.linspace(0.0, 1.8, 1801)
    theta = 1e-3 * np.interp(t, [0.0, 0.9, 1.3, 1.7, 1.8], [0.0, 0.9, 0.5, 0.9, 1.0])
    F = lg.simulate(lg.friction(law, Fv=0.0), t, np.gradient(theta, t)).outputs
    low, high = NESTED[law]
    assert low <= F[1700] - F[900] <= high


def both(model, t, u, rtol=1e-10):
    system = lg.plant(model)
    given = [u, 0.0 * u]
    ours = lg.simulate(system, t, given, rtol=rtol)
    return ours, simulate(system, t, given, rtol=1e-10, atol=1e-13, max_step=1e-3)


@pytest.mark.parametrize("case", ["stribeck, delta", "two_state", "leuven, elements", "bouc_wen"])
def test_the_engine_is_python_controls_own_away_from_rest(case):
    """The drive breaks away once and then keeps sliding."""
    t = np.linspace(0.0, 0.04, 21)
    ours, theirs = both(model_of(case), t, 0.8 + 0.3 * np.sin(60.0 * t))
    size = np.max(np.abs(theirs.states), axis=1, keepdims=True)
    assert np.max(np.abs(ours.states - theirs.states) / size) < 1e-6
    sliding = slice(1, None)  # at first it rests, held by friction, which tanh(0) is not
    np.testing.assert_allclose(
        ours.outputs[:, sliding], theirs.outputs[:, sliding], rtol=1e-5, atol=1e-6
    )


SAMPLED = [  # with a free exponent in substeps, for n = 1 too: a call may set another n
    ("lugre", {"delta": 1.0}, 1e-7),
    ("dahl", {"n": 2.0}, 1e-6),
    ("elastoplastic", {}, 1e-5),
]


@pytest.mark.parametrize(("law", "own", "error"), SAMPLED)
def test_a_sampled_law_is_right_at_constant_speed(law, own, error):
    block = lg.friction(law, **own)
    t = np.arange(40) * 1e-3
    for speed in (0.004, -2.0):
        exact = lg.simulate(block, t, np.full(40, speed), rtol=1e-10).outputs
        F = ct.forced_response(lg.sampled(block, 1e-3), t, np.full(40, speed)).outputs
        np.testing.assert_allclose(F[1:], exact[1:], rtol=error)


@every_case
def test_a_model_file_keeps_the_law(case, tmp_path):
    model = model_of(case)
    lg.write_model(model, tmp_path / "my.toml")
    again = lg.read_model(tmp_path / "my.toml")
    assert again == model and model_toml(again) == model_toml(model)
    assert lg.Model.of(model.to_dict(stated=True)) == model
    assert pickle.loads(pickle.dumps(model)) == model
    plant = lg.plant(model)
    assert plant.nstates == 2 + len(model.friction.block.states)
    assert pickle.loads(pickle.dumps(plant)).params == plant.params


@every_case
def test_nothing_but_the_named_values_is_to_be_identified(case):
    """Exponents and the like keep their usual value, held, until the model gives them."""
    law, own = CASES[case]
    model = lg.Model.of(friction=law)
    opened = {k for k, v in model.values().items() if v is None}
    assert opened == {"J", *TABLE1} & set(model.values())
    usual = {k for k, p in model.friction.block.parameters.items() if p.usual}
    assert model.held() == usual
    given = lg.Model.of(friction=law, **own)
    assert not given.held() & set(own)


def test_without_an_exponent_lugre_and_stribeck_are_what_they_were():
    """A neutral value changes nothing, nor does vd in steady sliding."""
    for law, own in [
        ("stribeck", {"delta": 2.0}),
        ("lugre", {"delta": 2.0}),
        ("lugre", {"vd": np.inf}),
    ]:
        assert lg.Model.of(friction=law).friction.block is LAWS[law]
        assert not {*own} & {*lg.Model.of(friction=law).values()}
        free, plain = (lg.friction(law, **v) for v in (own, {}))
        x = [2e-4] if free.nstates else []
        for w in (1e-3, 0.02, -3.0):
            assert free.output(0, x, [w]) == pytest.approx(plain.output(0, x, [w]), rel=1e-12)


def test_elements_come_by_number_or_by_lists():
    by_rule = lg.friction("maxwell_slip", elements=4, sigma0=100.0)
    listed = lg.friction("maxwell_slip", stiffness=[40, 30, 20, 10], share=[0.1, 0.2, 0.3, 0.4])
    x = np.array([1e-4, 2e-4, -3e-4, 9e-4])
    assert listed.params["maxwell_slip.sigma0"] == 100.0
    np.testing.assert_allclose(by_rule.output(0, x, [0.1]), listed.output(0, x, [0.1]), rtol=1e-14)
    np.testing.assert_allclose(
        by_rule.dynamics(0, x, [0.1]), listed.dynamics(0, x, [0.1]), rtol=1e-11
    )
    model = lg.Model.of(J=J, friction="leuven", share=[0.5, 0.25, 0.25])
    assert len(model.friction.block.states) == 3 and model.values()["sigma0"] is None
    assert "share = [0.5, 0.25, 0.25]" in model_toml(model)
    fitted = lg.Model.of(friction="maxwell_slip", stiffness=[3.0, 1.0]).with_values({"sigma0": 8.0})
    assert "stiffness = [0.75, 0.25]\nsigma0 = 8.0" in model_toml(fitted)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"elements": 2.5}, "elements must be a whole number from 1 on, not 2.5"),
        ({"elements": 99}, "99 elements; give 20 at most"),
        ({"share": [0.5, 0.4]}, "share adds up to 0.9; the shares must add up to 1"),
        ({"elements": 3, "share": [0.5, 0.5]}, "share has 2 numbers for 3 elements"),
        (
            {"stiffness": [1.0, 2.0], "share": [1.0]},
            "share has 1 numbers for 2 elements",
        ),
        ({"stiffness": [1.0, -2.0]}, "stiffness must be a list of positive numbers"),
        ({"stiffness": "stiff"}, "stiffness must be real numbers"),
        ({"stifness": [1.0]}, "unknown key 'stifness'"),
    ],
)
def test_wrong_elements_are_one_sentence(given, words):
    with pytest.raises(lg.InputError) as caught:
        lg.Model.of(friction="maxwell_slip", **given)
    assert words in str(caught.value) and str(caught.value).count(". ") <= 1


@pytest.mark.slow
def test_a_fit_finds_the_values_of_a_law_with_a_form():
    truth = lg.Model.of(P, delta=1.0)
    t = np.arange(0.0, 5.0, 1e-3)
    u = 0.3 * np.sin(8.2 * t) + 0.3 * np.sin(2.1 * t) + 0.25 * np.sin(19.0 * t)
    random = np.random.default_rng(3)
    theta, w, _ = lg.simulate(lg.plant(truth), t, [u, 0.0 * u], hold=True, rtol=1e-8).outputs
    record = {"t": t, "u": u, "theta": theta + 2e-6 * random.normal(size=len(t))}
    record["w"] = w + 1e-4 * random.normal(size=len(t))
    start = {k: 1.1 * v if k in ("J", "Fc", "Fv") else 0.9 * v for k, v in truth.values().items()}
    found = lg.identify(record, truth.with_values(start)).model.values()
    for key in ("J", "sigma0", "Fc", "Fv", "delta"):
        within = 0.05 if key == "delta" else 0.02
        assert found[key] == pytest.approx(truth.values()[key], rel=within), key

"""Tracking error before and after a model is augmented, in simulation."""

import json
import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

import lugrectl as lg
from lugrectl.bench.compensate import Spread, drawn, effects_torque
from lugrectl.blocks.model import model_from_dict
from lugrectl.cli import main
from lugrectl.core.errors import InputError
from lugrectl.estimates.findings import Joint, Table
from lugrectl.report import fragment, text

from ..cases.made_up import bare
from ..cases.made_up import diagnosis as diagnosed
from ..cases.schema import SCHEMA, VALID, closed, document, jsonschema

MODEL = lg.Model.of(lg.table1())
FULL = (
    MODEL.with_effect("gravity", {"amplitude": 0.1, "phase": 0.3})
    .with_effect("torque_ripple", {"amplitude": 0.04, "harmonic": 6.0, "phase": 0.0})
    .with_effect("coulomb_asymmetry", {"ratio": 0.15})
)


@pytest.fixture(scope="module")
def velocity():
    return lg.compensate(FULL, declared=MODEL)


@pytest.mark.slow
def test_the_augmented_model_tracks_better(velocity):
    assert velocity.after < 0.1 * velocity.before < 0.1 * velocity.none
    assert velocity.compensated == ("gravity", "torque_ripple", "coulomb_asymmetry")
    assert not velocity.left and not velocity.messages
    assert velocity.certificate and velocity.certificate.rate > 0.0


@pytest.mark.slow
def test_with_nothing_added_nothing_changes():
    c = lg.compensate(MODEL, declared=lg.table1())
    assert c.before == c.after < 1e-3 * c.none
    assert not c.compensated and not c.left


@pytest.mark.slow
def test_a_delay_is_not_compensated_and_a_loop_that_runs_away_is_said():
    late = MODEL.with_effect("input_delay", {"delay": 0.02})
    c = lg.compensate(late, kp=1.6, ki=0.16)
    assert [name for name, _ in c.left] == ["input_delay"] and not c.compensated
    assert "between the command and the motor" in c.left[0][1]
    assert c.after == math.inf and not c.runs
    assert any("unstable" in m and "augmented" in m for m in c.messages)
    said = c.summary()
    json.dumps(said, allow_nan=False)
    assert said["after"] is None
    assert len(c.plot(Figure().subplots()).lines) == 0


def test_gains_given_are_used_and_certified():
    gains = {"K1": -10.24, "K2": 22.0}
    loops = lg.compensate(MODEL, kp=1.6, ki=0.16, observer="proposed", **gains)
    assert loops.gains["before"] == loops.gains["after"] == gains
    assert loops.controller == {"kp": 1.6, "ki": 0.16}
    assert loops.certificate.rate == pytest.approx(lg.certify(lg.table1(), **gains).rate)


@pytest.mark.parametrize(
    "options, said",
    [
        ({"loop": "torque"}, "unknown loop"),
        ({"kd": 1.0}, "kd"),
        ({"K1": -1.0}, "both K1 and K2"),
        ({"bandwidth": -1.0}, "bandwidth"),
        ({"reference": ([0.0, 1.0], [0.0])}, "reference"),
        ({"reference": ([0.0, 2.0, 1.0], [0.0, 0.0, 0.0])}, "increase"),
        ({"observer": "strange"}, "no observer named"),
        ({"covariance": np.eye(2)}, "covariance must be that of a diagnosis"),
        ({"draws": 0}, "draws must be a whole number"),
    ],
)
def test_wrong_usage_is_one_sentence(options, said):
    with pytest.raises(InputError, match=said):
        lg.compensate(MODEL, **options)


def test_another_friction_law_needs_another_observer():
    law = lg.Model.of(lg.table1())
    coulomb = model_from_dict(
        {"plant": {"J": law.J}, "friction": {"model": "coulomb", "Fc": 0.3, "Fv": 0.02}}, "here"
    )
    with pytest.raises(InputError, match="disturbance"):
        lg.compensate(coulomb)


# --- the torque that is fed forward ------------------------------------------------------


def test_torque_effects_are_fed_forward_as_they_act():
    model = MODEL.with_effect("gravity", {"amplitude": 0.2, "phase": 0.5})
    model = model.with_effect("quadratic_drag", {"coefficient": 0.03})
    block = effects_torque(model)
    assert block.nstates == 0
    for w, theta in ((0.0, 1.0), (-2.0, 0.3), (3.0, -4.0)):
        expected = 0.2 * np.sin(theta + 0.5) + 0.03 * w * abs(w)
        assert block.output(0.0, [], [w, theta])[0] == pytest.approx(expected)


def test_a_level_effect_settles_at_the_difference_of_friction():
    block = effects_torque(MODEL.with_effect("coulomb_asymmetry", {"ratio": 0.1}))
    t = np.linspace(0.0, 1.0, 201)
    for w in (1.0, -1.0):
        u = np.ravel(lg.simulate(block, t, {"w_m": w, "theta_m": 0.0}).outputs)
        assert u[0] == pytest.approx(0.0, abs=1e-9)  # no step at the start
        assert u[-1] == pytest.approx(0.1 * 0.285, rel=1e-3)


def test_what_cannot_be_compensated_makes_no_block():
    assert effects_torque(MODEL) is None
    late = MODEL.with_effect("actuator_lag", {"time_constant": 0.01})
    values = {"load_inertia": 1e-3, "stiffness": 20.0, "damping": 0.01}
    assert effects_torque(late.with_effect("elastic_coupling", values)) is None


@pytest.mark.slow
def test_a_table_acts_and_is_compensated():
    x = np.linspace(-2.0, 2.0, 9)
    values = 0.08 * np.cos(2 * x)
    table = Table(("theta",), x, values, 0 * x, False, 0.5, (0.4, 0.6), 0.05, "N m", 9)
    c = lg.compensate(MODEL, observer="natural", table=table)
    assert c.after < 0.2 * c.before and c.compensated == (table.name,)


# --- reports and command line ------------------------------------------------------------


def test_reports_carry_table_and_compensation(driven):
    x = np.linspace(-2.0, 2.0, 9)
    table = Table(("theta",), x, np.cos(x), 0 * x + 0.1, False, 0.5, (0.4, 0.6), 0.05, "N m", 9)
    d = SimpleNamespace(**vars(bare("unexplained")) | {"table": table, "compensation": driven})
    said = text(d)
    assert max(map(len, said.splitlines())) <= 80
    assert "unexplained residual over theta (table, no physics)" in said
    assert "50 % (40 to 60 %" in said and "velocity loop" in said
    page = fragment(d)
    assert 'aria-label="table"' in page and 'aria-label="tracking"' in page


@pytest.mark.slow
def test_command_line(tmp_path, capsys):
    from importlib import resources

    folder = resources.files("lugrectl") / "demo"
    line = ["diagnose", str(folder / "record.csv"), "--model", str(folder / "model.toml")]
    assert main([*line, "--compensate", "velocity", "--json", "--out", str(tmp_path / "x")]) == 0
    made = json.loads(capsys.readouterr().out)["compensation"]
    assert made["after"] < made["before"] and made["loop"] == "velocity"
    assert "Compensation in simulation" in (tmp_path / "x" / "report.html").read_text()


# --- drives like the recorded one, which are not exactly the model -----------------------

VISCOUS = lg.Model.of(J=0.0022, friction="viscous", Fv=0.0005)
HEAVY = VISCOUS.with_effect("gravity", {"amplitude": 0.3, "phase": 0.3})
COUNT = 2 * np.pi / 8192
NAMES = ("J", "Fv", "gravity.amplitude")


def record(rate=1000.0, speed_noise=0.01, seconds=3.0):
    rng, t = np.random.default_rng(0), np.arange(0.0, seconds, 1.0 / rate)
    theta, w = -0.64 * np.cos(1.57 * t), np.sin(1.57 * t)
    return lg.Record(
        t=t,
        u=0.02 * np.sign(w) + rng.normal(0.0, 0.004, len(t)),
        theta=COUNT * np.round(theta / COUNT),
        w=w + rng.normal(0.0, speed_noise, len(t)),
    )


def joint(share):
    values = np.array([HEAVY.values()[name] for name in NAMES])
    return Joint(NAMES, values, np.diag((share * values) ** 2), np.full(3, True))


def compensated(share=0.05, draws=6, **options):
    own = {"declared": VISCOUS, "observer": None, "record": record(), "covariance": joint(share)}
    return lg.compensate(HEAVY, draws=draws, **own | options)


@pytest.fixture(scope="module")
def driven():
    return compensated()


@pytest.mark.slow
def test_the_errors_of_the_exact_model_stay_and_those_of_a_drive_stand_beside(driven):
    assert driven.after < 0.1 * driven.before  # drive and belief are one model
    after, low, high = driven.drive.of("after")
    assert 10 * driven.after < low <= after <= high
    assert driven.drive.best == "after"
    assert not [m for m in driven.messages if "like the recorded one" in m]


def test_sample_time_encoder_counts_and_noise_are_those_of_the_record(driven):
    drive = driven.drive
    assert drive.rate == pytest.approx(1000.0)
    assert drive.resolution == pytest.approx(COUNT)
    assert drive.noise["w"] == pytest.approx(0.01, rel=0.1)
    assert drive.noise["u"] == pytest.approx(0.004, rel=0.1)
    assert drive.drawn == NAMES and len(drive.errors["after"]) == 6


def test_without_a_covariance_the_drive_has_the_estimate_and_without_a_record_there_is_none():
    c = lg.compensate(HEAVY, declared=VISCOUS, observer=None, record=record())
    assert c.drive.drawn == () and len(c.drive.errors["after"]) == 1
    assert lg.compensate(VISCOUS, observer=None).drive is None


def test_a_compensation_that_makes_tracking_worse_says_so_and_advises_to_leave_it_off():
    """The drive's gravity acts the other way round: the compensation doubles it."""
    other = Joint(("gravity.phase",), np.array([0.3 - np.pi]), np.eye(1) * 1e-4, np.array([False]))
    c = compensated(covariance=other)
    (none, *_), (after, *_) = (c.drive.of(key) for key in ("none", "after"))
    assert after > 1.5 * none and c.drive.best != "after"
    (said,) = [m for m in c.messages if m.startswith("On a drive like the recorded one")]
    assert said == (
        "On a drive like the recorded one the compensation makes tracking worse: median error "
        f"{after:.3g} rad/s with it, {none:.3g} rad/s without; leave it off."
    )
    assert c.after < c.none  # in simulation of the exact model it helps


def test_a_loop_that_diverges_on_some_drives_is_counted_and_has_an_infinite_end():
    errors = {"none": np.ones(5), "before": np.ones(5), "after": np.array([1, 1, 1, 1, np.inf])}
    spread = Spread(1000.0, {"theta": 0.0, "w": math.nan, "u": 0.0}, 0.0, (), 0, errors)
    assert spread.of("after") == (1.0, 1.0, math.inf)
    said = spread.summary()
    assert said["after"]["diverged"] == 1 and said["recommended"] == "none"
    most = replace(spread, errors=errors | {"after": np.full(5, np.inf)})
    assert "unstable with it" in most.advice("rad")[0]


def test_drawn_parameters_stay_inside_their_bounds():
    drives, names = drawn(HEAVY, joint(3.0), 50, 0)
    assert names == NAMES
    assert all(one.J > 0 and one.values()["gravity.amplitude"] >= 0 for one in drives)
    assert len({one.J for one in drives}) == 50
    assert drives[0].values() == drawn(HEAVY, joint(3.0), 50, 0)[0][0].values()


def test_the_report_and_its_schema_carry_the_spread(driven):
    d = replace(diagnosed(), compensation=driven)
    said = text(d)
    assert "on a drive, after" in said
    assert max(map(len, said.splitlines())) <= 80
    whole = document(d)
    VALID.validate(whole)
    jsonschema.Draft202012Validator(closed(SCHEMA)).validate(whole)
    drive = whole["compensation"]["drive"]
    assert drive["draws"] == 6 and drive["none"]["low"] <= drive["none"]["median"]
    json.dumps(whole, allow_nan=False)
    assert "on a drive, after" in repr(driven)

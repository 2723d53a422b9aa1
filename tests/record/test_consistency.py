"""What is noticed about a record, and above all what is left alone when nothing is wrong."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter

from lugrectl.core.errors import InputError, Refused
from lugrectl.record import Record, consistent, read_record
from lugrectl.record.consistency import audit as checked
from lugrectl.record.log import log_of_arrays
from lugrectl.record.samples.bad_samples import unwrap_positions
from lugrectl.record.samples.rows import Stamped

from ..cases.logs import DATA, driven, measured, rubbing


def audit(record):
    """What reading does with the rows of a record."""
    return checked(consistent(record))


def run(n=8000, dt=1e-3, J=2e-3, Fc=0.2, Fv=0.02, gravity=0.0, spring=0.0, seed=1):
    """A mass with friction, pendulum and spring."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    u = 0.7 * np.sin(2 * np.pi * 0.6 * t) + 0.35 * np.sin(2 * np.pi * 2.3 * t + 1.0)
    u += 0.1 * np.sin(2 * np.pi * 7.1 * t) + gravity * rng.uniform(0.5, 1.0)
    load = rubbing(J, Fc, Fv, 0.1, lambda angle: gravity * math.sin(angle) + spring * angle)
    w, theta = driven(u, dt, load, 5)
    w += 2e-3 * rng.standard_normal(n)
    return Record(t, u, w, np.round(theta / 1e-4) * 1e-4, dt=dt, source="run")


PLAIN = run()
RPM, DEG, TURN = np.pi / 30, np.pi / 180, 2 * np.pi


def said(record):
    return " ".join(record.messages)


SOUND = [
    PLAIN,
    run(gravity=0.4),
    run(spring=0.3),
    run(Fc=0.02, Fv=0.0, J=2e-2),
    run(n=1000),
    run(n=300, dt=5e-3),
    replace(PLAIN, motion="linear"),
    replace(PLAIN, gaps=(3000, 6000)),
]


@measured
@pytest.mark.parametrize("number", range(1, 9))
@pytest.mark.parametrize("without", [None, "w", "theta"])
def test_nothing_is_said_of_measured_records(number, without):
    record = read_record(DATA / "bench" / f"{number:02d}" / "record.csv")
    record = replace(record, **{without: None}) if without else record
    assert audit(record).messages == ()


@pytest.mark.parametrize("record", SOUND)
@pytest.mark.parametrize("without", [None, "w", "theta"])
def test_a_sound_record_stays_as_it_is(record, without):
    record = replace(record, **{without: None}) if without else record
    seen = audit(record)
    assert seen.messages == ()
    for role, values in record.channels().items():
        np.testing.assert_array_equal(getattr(seen, role), values)


# ---- wrapped angles -----------------------------------------------------------------


def test_wrapped_degrees_without_a_unit_are_converted():
    seen = audit(replace(PLAIN, w=None, theta=np.rad2deg(PLAIN.theta) % 360))
    np.testing.assert_allclose(seen.theta, PLAIN.theta - PLAIN.theta[0], atol=1e-9)
    assert len(seen.messages) == 1 and "converted from deg" in said(seen)


@settings(max_examples=25)
@given(st.lists(st.floats(-0.4, 0.4), min_size=20, max_size=200))
def test_unwrapping_never_invents_a_jump(steps):
    """A smooth angle that never nears half a turn in one step is left alone."""
    theta = np.cumsum(steps)
    log = log_of_arrays("log", {"t": np.arange(float(len(theta))), "theta": theta}, "rotary")
    rows = Stamped.of(log)
    unwrap_positions(rows)
    assert rows.said == [] and rows.channels["theta"] is theta


# ---- w against theta ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("role", "factor", "unit"),
    [
        ("w", 1 / RPM, "rpm"),
        ("w", 1 / DEG, "deg/s"),
        ("w", 1 / TURN, "rev/s"),
        ("theta", 1 / DEG, "deg"),
        ("theta", 1 / TURN, "rev"),
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_mixed_up_unit_is_put_right(role, factor, unit, sign):
    wrong = replace(PLAIN, **{role: getattr(PLAIN, role) * factor})
    seen = audit(replace(wrong, w=sign * wrong.w))
    assert f"{role} is taken in" in said(seen) and f"in fact in {unit}" in said(seen)
    np.testing.assert_allclose(seen.w, PLAIN.w, rtol=1e-12)
    np.testing.assert_allclose(seen.theta, PLAIN.theta, rtol=1e-12)
    assert len(seen.messages) == (1 if sign > 0 else 2)


def test_units_stated_decide_which_channel_is_wrong(tmp_path):
    """w is 57.3 times d theta/dt: w in deg/s, or theta stated in deg though it is in rad."""
    np.savez(tmp_path / "a.npz", **{"t": PLAIN.t, "u": PLAIN.u, "w [rad/s]": PLAIN.w / DEG,
                                    "theta": PLAIN.theta})  # fmt: skip
    np.testing.assert_allclose(read_record(tmp_path / "a.npz").w, PLAIN.w, rtol=1e-12)
    np.savez(tmp_path / "b.npz", **{"t": PLAIN.t, "u": PLAIN.u, "w [rpm]": PLAIN.w,
                                    "theta": PLAIN.theta})  # fmt: skip
    seen = read_record(tmp_path / "b.npz")
    np.testing.assert_allclose(seen.w, PLAIN.w, rtol=1e-12)
    assert "w is stated in rpm but in fact in rad/s" in said(seen)


@pytest.mark.parametrize("offset", [0.3, -0.2])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_speed_that_is_off_by_a_constant_is_said_and_not_used(offset, noise):
    rng = np.random.default_rng(0)
    seen = audit(replace(PLAIN, w=PLAIN.w + offset + noise * rng.standard_normal(8000)))
    (sentence,) = seen.messages
    assert seen.w is None and f"too {'high' if offset > 0 else 'low'}" in sentence
    assert float(sentence.split()[2]) == pytest.approx(abs(offset), rel=0.1)


@pytest.mark.parametrize("speed", [0.5, -3.0, 40.0])
def test_a_speed_beside_an_angle_is_compared_only_where_it_varies(speed):
    rng = np.random.default_rng(4)
    t = np.arange(1500) * 2e-3
    w = speed + 2e-3 * rng.standard_normal(1500)
    theta = np.round(speed * t / 1e-4) * 1e-4
    u = np.full(1500, 0.2 * np.sign(speed)) + 1e-3 * rng.standard_normal(1500)
    seen = audit(Record(t, u, w, theta, source="steady"))
    assert seen.messages == () and seen.w is not None
    constant = audit(Record(t, np.full(1500, 0.2), w, theta))
    assert constant.messages == ()
    wrong = audit(Record(t, u, 30 / np.pi * w, theta))
    assert "in fact in rpm" in said(wrong)


def test_the_sign_follows_the_position():
    seen = audit(replace(PLAIN, w=-PLAIN.w))
    np.testing.assert_array_equal(seen.w, PLAIN.w)
    assert seen.messages == ("w has the opposite sign of d theta/dt: its sign was changed.",)


@pytest.mark.parametrize("n", [12, 39, 60, 120])
def test_a_few_samples_are_left_as_they_are(n):
    """Slow signals without their ends are nothing then."""
    few = run().slice(500, 500 + n)
    assert audit(few).w is not None and audit(few).messages == ()


@pytest.mark.parametrize("factor", [0.9, 1.06, 3.7, -5.0])
def test_another_ratio_means_that_w_is_ignored(factor):
    seen = audit(replace(PLAIN, w=factor * PLAIN.w))
    assert seen.w is None and f"{factor:.4g} times" in said(seen)


def lag_in(sentence):
    return float(sentence.split("lags theta by ")[1].split(" ms")[0])


@pytest.mark.parametrize("tau", [4e-3, 20e-3, 60e-3])
def test_a_filtered_velocity_is_said_and_left(tau):
    """First-order filter of time constant tau: its group delay at low frequency is tau."""
    a = np.exp(-PLAIN.dt / tau)
    filtered = replace(PLAIN, w=lfilter([1 - a], [1, -a], PLAIN.w))
    seen = audit(filtered)
    np.testing.assert_array_equal(seen.w, filtered.w)
    (sentence,) = seen.messages
    assert lag_in(sentence) == pytest.approx(1e3 * PLAIN.dt * a / (1 - a), rel=0.05)


# ---- dead channels ------------------------------------------------------------------


NOISE = np.random.default_rng(0).standard_normal(8000)
STILL = np.zeros(8000)


@pytest.mark.parametrize(
    ("channels", "words"),
    [
        *(({"u": np.full(8000, x)}, "dead torque channel") for x in (0.0, 5.0, -1e-3)),
        ({"w": STILL, "theta": None}, "w is constant .*nothing moves"),
        ({"theta": STILL}, "theta is constant .*nothing moves"),
        ({"w": None, "theta": 1e-4 * (np.arange(8000) // 7 % 2)}, "2 values"),
        ({"w": NOISE, "theta": None}, "nothing moves"),
    ],
)
def test_a_channel_in_which_nothing_moves_is_refused(channels, words):
    with pytest.raises(Refused, match=words):
        audit(replace(PLAIN, **channels))


@pytest.mark.parametrize("value", [0.0, 7.0])
def test_a_dead_speed_beside_a_position_that_moves_is_left_out(value):
    found = audit(replace(PLAIN, w=np.full(8000, value)))
    assert found.w is None and np.array_equal(found.theta, PLAIN.theta)
    assert found.messages[0].startswith(f"w is not d theta/dt but constant ({value:g})")


@pytest.mark.parametrize("other", ["u", "theta"])
def test_a_speed_in_another_column_is_refused(other):
    exchanged = {other: PLAIN.w, "w": getattr(PLAIN, other)}
    with pytest.raises(InputError, match=f"{other} holds the speed.*swapped.*{other}=NAME,w=NAME"):
        audit(replace(PLAIN, **exchanged))

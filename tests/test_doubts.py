"""Records that cannot answer are refused for the right reason, and sound ones are not."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl import diagnose, identify, read_model, read_record
from lugrectl.errors import Refused
from lugrectl.record import Record
from lugrectl.tracing.balance import balance, cells
from lugrectl.tracing.data import prepare
from lugrectl.tracing.doubts import refuse_dead, refuse_unfit
from lugrectl.tracing.skewed import sensor_skew, skew
from tests.blind.plan import Task
from tests.blind.work import case_of
from tests.rig import make, sample

from .cases import model_of, record_of
from .logs import DATA, measured

RATE, N = 500.0, 8000


@pytest.fixture(scope="module")
def case():
    return make("none", machine="stage", excitation="torque", seed=31, rate=RATE, duration=16.0)


@pytest.fixture(scope="module")
def plain(case):
    return record_of(case)


@pytest.fixture(scope="module")
def model(case):
    return model_of(case)


def looked_over(record, model):
    return refuse_unfit([record], model, prepare([record]))


def refused(record, model, match):
    with pytest.raises(Refused, match=match) as caught:
        looked_over(record, model)
    reason, experiment = str(caught.value), caught.value.experiment
    assert reason.endswith(".") and experiment and experiment[0].isupper()
    assert len(reason) < 250 and "\n" not in reason
    return reason


def shifted(x, k):
    """x, k samples later."""
    return np.concatenate([np.full(max(k, 0), x[0]), x[max(-k, 0) : len(x) - max(k, 0)],
                           np.full(max(-k, 0), x[-1])])  # fmt: skip


# ---- sound records ------------------------------------------------------------------


def test_a_sound_record_passes_without_a_word(plain, model):
    assert looked_over(plain, model) == ()
    assert looked_over(plain, model.with_values({"J": None})) == ()


@pytest.mark.parametrize(
    "effect, seed",
    [
        *[(e, 7000) for e in ("input_delay", "velocity_sensor_lag", "elastic_coupling")],
        *[(e, 7001) for e in ("backlash", "actuator_saturation", "hard_stop", "return_spring")],
        *[(e, 7002) for e in ("actuator_dead_zone", "inertia_step", "presliding", "none")],
        *[(e, 7000) for e in ("dragged_cable", "torque_droop", "decaying_burst")],
    ],
)
def test_no_hidden_effect_is_taken_for_a_broken_record(effect, seed):
    case = sample(effect, seed, duration=15.0, rate=500.0)
    looked_over(record_of(case), model_of(case))


@measured
@pytest.mark.parametrize("number", range(1, 9))
def test_bench_records_pass(number):
    folder = DATA / "bench" / f"{number:02d}"
    assert looked_over(read_record(folder / "record.csv"), read_model(folder / "model.toml")) == ()


def test_the_balance_finds_the_machine(case, plain):
    data = prepare([plain])
    fit = balance(data, cells(data))
    assert abs(fit.J - case.truth["plant"]["J"]) < 0.02 * fit.J
    assert fit.J > 50 * fit.error and fit.power_t > 10
    assert fit.torque(data, fit.cells) == pytest.approx(fit.terms @ fit.x)


# ---- the torque channel -------------------------------------------------------------


@pytest.mark.parametrize("value", [0.0, 3.0])
def test_constant_channels(plain, value):
    for role in ("u", "w", "theta"):
        record = replace(plain, **{role: np.full(N, value)})
        with pytest.raises(Refused, match=f"{role} is constant"):
            refuse_dead([record])


@pytest.mark.parametrize("dead", [slice(3000, None), slice(800, None), slice(3000, 4500)])
def test_a_torque_that_dies(plain, model, dead):
    u = plain.u.copy()
    u[dead] = 0.0
    reason = refused(replace(plain, u=u), model, "channel is dead there")
    share = 100 * len(u[dead]) / N
    assert f"u stays at 0 N for {share:.2g} %" in reason


def machine(law, J=0.01, Fc=0.2, Fv=0.05):
    """Mass and friction by Euler under a held torque ``law(k, t, measured w)``."""
    rng, dt = np.random.default_rng(0), 2e-3
    t = np.arange(N) * dt
    u, w, speed = np.zeros(N), np.zeros(N), 0.0
    for k in range(N):
        w[k] = speed + 1e-3 * rng.standard_normal()
        u[k] = law(k, t[k], w[k])
        for _ in range(10):
            speed += 0.1 * dt / J * (u[k] - Fc * np.tanh(speed / 0.02) - Fv * speed)
    return Record(t, u, w, dt=dt)


@pytest.fixture(scope="module")
def rotary(model):
    return replace(model, motion="rotary", J=0.01)


def test_coasting_is_not_a_dead_channel(rotary):
    """Kicked by a held torque, one way and the other, and left alone for most of the time."""
    kicks = np.random.default_rng(0).uniform(0.8, 2.0, N)

    def law(k, t, w):
        return kicks[k // 50] * (1.0 if t % 4 < 2 else -1.0) * (t % 2 < 0.5)

    record = machine(law)
    assert np.mean(record.u == 0.0) > 0.5
    assert looked_over(record, rotary) == ()


def test_a_few_levels_are_no_clipping(rotary):
    record = machine(lambda k, t, w: 0.8 * np.sign(np.sin(3.0 * t + np.sin(t))))
    assert len(np.unique(record.u)) <= 3
    assert looked_over(record, rotary) == ()


def test_a_clipped_log(plain, model):
    for share, hard in ((0.25, True), (0.015, False)):
        limit = float(np.quantile(plain.u, 1 - share))
        record = replace(plain, u=np.minimum(plain.u, limit))
        if hard:
            assert f"{limit:.4g}" in refused(record, model, "channel is clipped there")
        else:
            assert all("may be clipped" in m for m in looked_over(record, model))


@pytest.mark.parametrize("share", [0.3, -0.3])
def test_a_copy_of_another_column(plain, model, share):
    dt = plain.dt
    made = {
        "w": plain.w,
        "the difference of w": np.gradient(plain.w, dt),
        "theta": plain.theta,
    }
    for name, x in made.items():
        for u in (share * x, np.round(share * x / np.ptp(x), 6)):
            reason = refused(replace(plain, u=u), model, "no torque|not the torque|does not")
            assert name in reason or "opposite sign" in reason


def test_a_reference_for_a_torque(model):
    case = make("none", machine="stage", excitation="rich", seed=3, rate=RATE, duration=16.0,
                channels=("r",))  # fmt: skip
    record = record_of(case)
    assert looked_over(record, model) == ()
    refused(replace(record, u=40.0 * record.r), model, "u equals 40 times the reference r")


def test_a_torque_reference_may_be_the_torque(plain, model):
    assert looked_over(replace(plain, r=plain.u), model) == ()


def test_a_controller_law_is_sound(rotary):
    """u = kp (r - w) + ki integral, exactly, of the recorded w: what every loop does."""
    total = [0.0]

    def law(k, t, w):
        error = 2.0 * np.sin(2.0 * t) + np.sin(7.0 * t) - w
        total[0] += 2e-3 * error
        return 0.6 * error + 3.0 * total[0]

    assert looked_over(machine(law), rotary) == ()


def test_the_torque_of_another_run(plain, model):
    refused(replace(plain, u=plain.u[::-1].copy()), model, "unrelated|opposite sign")
    noise = np.random.default_rng(1).standard_normal(N)
    refused(replace(plain, u=noise), model, "unrelated to the motion")


def test_the_other_sign(plain, model):
    refused(replace(plain, u=-plain.u), model, "opposite sign")


@pytest.mark.parametrize("factor", [1e-3, 1e4])
def test_an_inertia_in_another_unit_is_said(plain, model, factor):
    wrong = replace(model, J=model.J * factor)
    reason = refused(plain, wrong, "another unit")
    assert f"J = {wrong.J:.3g} kg" in reason


@pytest.mark.parametrize("factor", [0.1, 8.0])
def test_a_bad_guess_of_the_inertia_is_said(plain, model, factor):
    (said,) = looked_over(plain, replace(model, J=model.J * factor))
    assert "a factor of" in said and "units" in said


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_fair_guess_of_the_inertia_is_taken(plain, model, factor):
    assert looked_over(plain, replace(model, J=model.J * factor)) == ()


# ---- skew ---------------------------------------------------------------------------


@pytest.mark.parametrize("late", [3, 25])
def test_a_late_torque_is_a_skew_and_an_early_one_a_delay(plain, model, late):
    reason = refused(replace(plain, u=shifted(plain.u, late)), model, "skewed in time")
    told = float(reason.split("motion is ")[1].split(" ms")[0])
    assert told == pytest.approx(1e3 * late / RATE, abs=0.4 * 1e3 / RATE)
    early = replace(plain, u=shifted(plain.u, -late))
    assert looked_over(early, model) == ()
    assert skew(prepare([early]), 0.2).lag == pytest.approx(late / RATE, abs=0.4 / RATE)


def test_a_small_skew_is_said(plain, model):
    (remark,) = looked_over(replace(plain, u=shifted(plain.u, 2)), model)
    assert "they may be skewed in time" in remark


@pytest.mark.parametrize("early", [2, 10])
def test_an_early_velocity_is_a_skew_and_a_late_one_a_filter(plain, model, early):
    reason = refused(replace(plain, w=shifted(plain.w, -early)), model, "ahead of d theta/dt")
    told = float(reason.split("w is ")[1].split(" ms")[0])
    assert told == pytest.approx(1e3 * early / RATE, abs=0.4 * 1e3 / RATE)
    late = replace(plain, w=shifted(plain.w, early))
    assert not any("skew" in m for m in looked_over(late, model))
    assert sensor_skew(prepare([late]), 0.2).lag < 0


@pytest.mark.parametrize("seed", [98045, 98098])
def test_friction_that_builds_up_late_is_no_skew(seed):
    """Large drives that slide slowly over soft bristles: friction, not the torque, is late."""
    case = case_of(Task("none", (), "normal", seed))
    record = record_of(case)
    assert looked_over(record, model_of(case)) == ()
    late = round(0.01 * case.truth["rate"])
    found = skew(prepare([replace(record, u=shifted(record.u, late))]), 0.2)
    assert found is None or found.lag > -0.0105


@pytest.mark.parametrize("seed", [113010, 120002])
def test_friction_that_changes_on_the_way_is_no_skew(seed):
    case = case_of(Task("effect", ("friction_step",), "normal", seed))
    assert looked_over(record_of(case), model_of(case)) == ()


def test_half_a_sample_is_no_skew(plain, model):
    """Velocity as the difference to the next position is half a sample early."""
    ahead = np.append(np.diff(plain.theta), 0.0) * RATE
    assert looked_over(replace(plain, w=ahead), model) == ()
    assert looked_over(replace(plain, w=ahead, theta=None), model) == ()


# ---- motion -------------------------------------------------------------------------


def driven(speed, J=0.01, Fc=0.2, Fv=0.05, noise=1e-3, torque_noise=1e-3, seed=0):
    """The torque that a speed takes, with noise on both."""
    rng, dt = np.random.default_rng(seed), 2e-3
    u = J * np.append(np.diff(speed), 0.0) / dt + Fc * np.tanh(speed / 1e-3) + Fv * speed
    w = speed + noise * rng.standard_normal(len(speed))
    t = np.arange(len(speed)) * dt
    return Record(t, u + torque_noise * rng.standard_normal(len(speed)), w, dt=dt)


T = np.arange(N) * 2e-3


def test_one_direction(rotary):
    one_way = driven(2.0 + np.sin(3 * T) + 0.5 * np.sin(7 * T))
    refused(one_way, rotary, "one direction only")
    viscous = replace(rotary, friction=replace(rotary.friction, values={"Fv": 0.1}))
    assert any("one direction only" in m for m in looked_over(one_way, viscous))


def test_one_speed(rotary):
    turns = np.clip(40 * np.sin(1.3 * T), -1.0, 1.0) * 2.0
    reason = refused(driven(turns), rotary, "one speed only")
    assert "1.9" in reason or "2" in reason
    assert looked_over(driven(2.0 * np.sin(1.3 * T)), rotary) == ()
    pool = [driven(turns), driven(0.3 * turns, seed=1)]
    assert refuse_unfit(pool, rotary, prepare(pool)) == ()


def test_a_motion_of_a_few_steps(plain, model):
    q = float(np.ptp(plain.theta)) / 6
    coarse = replace(plain, w=None, theta=np.round(plain.theta / q) * q)
    refused(coarse, model, "hardly moves")
    still = driven(0.0 * T, noise=1e-2, torque_noise=0.1)
    refused(still, model, "hardly moves")


def test_too_little_motion(model):
    speed = np.where(T < 0.8, 2.0 * np.sin(2 * np.pi * T / 0.4), 0.0)
    refused(driven(speed), model, "too short: the drive moves for")


@pytest.mark.slow
def test_an_inertia_that_does_not_show(model):
    slow = driven(2.0 * np.sin(0.7 * T), J=2e-4, torque_noise=0.1)
    (remark,) = looked_over(slow, model.with_values({"J": 2e-4}))
    assert "relies on the declared J" in remark and "acceleration is 1 rad" in remark
    opened = model.with_values({"J": None})
    assert looked_over(slow, opened) == ()  # a fit may know more
    refused = diagnose(slow, opened)
    assert "determines the inertia" in refused.reason and "declare J" in refused.experiment


def test_an_inertia_that_a_fit_finds_and_a_balance_does_not():
    case = make("none", machine="joint", excitation="sparse", seed=19, rate=1000.0, duration=10.0)
    opened = model_of(case).with_values({"J": None})
    found = identify(record_of(case), opened).model.J
    assert found == pytest.approx(case.truth["plant"]["J"], rel=0.01)


def test_a_negative_inertia(model):
    refused(driven(2.0 * np.sin(3 * T) + np.sin(11 * T), J=-0.02), model, "opposite sign")


# ---- time ---------------------------------------------------------------------------


def test_lost_samples(plain, model):
    t = plain.t + np.repeat(np.arange(8), 1000) * 3.0
    gaps = tuple(range(1000, N, 1000))
    refused(replace(plain, t=t, gaps=gaps), model, "are lost: 7 gaps")
    t = plain.t + (np.arange(N) >= 4000) * 3.0
    (remark,) = looked_over(replace(plain, t=t, gaps=(4000,)), model)
    assert "16 % of the time is lost" in remark


def test_stamps_off_the_grid(plain, model):
    kept = np.sort(np.random.default_rng(0).choice(N, 7000, replace=False))
    cut = {k: v[kept] for k, v in plain.channels().items()}
    refused(replace(plain, **cut), model, "lost or irregular")

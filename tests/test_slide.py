"""What the balance of the sliding drive lacks: torques that were not recorded, put into a log."""

from dataclasses import replace

import numpy as np
import pytest

from lugrectl.tracing.dependence import Dependence, clearest, judged
from lugrectl.tracing.job import begin
from lugrectl.tracing.rest import left_over, signals_of_the_rest
from lugrectl.tracing.slide import (
    BLOCKS,
    MOST,
    _enough,
    hidden_in_noise,
    missing_function,
    while_sliding,
)
from tests.rig import sample

from .test_hanging import bump, hump, knocks, refitted, slider, whole_drive
from .test_tracing import model_of, quiet, record_of


@pytest.fixture(scope="module")
def plain():
    return whole_drive()


@pytest.fixture(scope="module")
def whole(plain):
    return refitted(plain, lambda t, theta, w: 0.0 * t)


@pytest.fixture(scope="module")
def bumpy(plain):
    return refitted(plain, lambda t, theta, w: 3.0 * bump(t, theta, w))


def wandering(t, theta, w):
    """Coulomb friction that goes up and down."""
    return 0.8 * np.sin(0.9 * t) * np.tanh(w / 0.01)


def rough_patches(t, theta, w):
    """Viscous friction that differs from place to place."""
    return 0.3 * np.sin(2.0 * theta) * w


@pytest.mark.parametrize(
    "torque, signals",
    [(bump, ("theta",)), (hump, ("w",)), (slider, ("theta", "w")), (rough_patches, ("theta", "w"))],
)
def test_a_missing_torque_is_a_function_of_its_signals(plain, torque, signals):
    missing = missing_function(refitted(plain, torque))
    assert missing is not None and missing.signals == signals
    assert missing.share > 0.9 and missing.torque < missing.whole


def test_a_loss_in_the_drive_is_a_function_of_the_torque(plain):
    record = record_of(plain)
    lost = 0.2 * record.u * np.abs(record.u) / np.max(np.abs(record.u))
    fitted = begin(replace(record, u=record.u + lost), model_of(plain), None, 1.0, quiet).base
    missing = missing_function(fitted)
    assert missing is not None and missing.signals == ("u",)


def behind(x, reach):
    """A signal behind a play of so much either way."""
    made = np.empty_like(x)
    now = x[0]
    for i, value in enumerate(x):
        made[i] = now = min(max(now, value - reach), value + reach)
    return made


def test_a_torque_with_play_is_a_function_of_the_torque(plain):
    """Of what it was before, too: of its value at the moment alone it is hardly one."""
    record = record_of(plain)
    stuck = record.u - behind(record.u, 0.05 * float(np.ptp(record.u)))
    made = replace(record, u=record.u + stuck)
    sliding = while_sliding(begin(made, model_of(plain), None, 1.0, quiet).base)
    best = sliding.of_signals()
    assert best is not None and best.signals == ("u",) and best.share > 0.95
    assert max(d.share for d in sliding.dependences if d is not best and "u" in d.signals) < 0.7


@pytest.mark.slow
@pytest.mark.sample
def test_a_cable_that_drags_is_a_function_of_the_way(plain):
    def dragged(t, theta, w):
        return sum(theta - behind(theta, r * np.ptp(theta)) for r in (0.03, 0.06, 0.1)) * 0.5

    sliding = while_sliding(refitted(plain, dragged))
    best = sliding.of_signals()
    assert best is not None and best.signals == ("theta", "w") and best.share > 0.7
    assert max(d.share for d in sliding.dependences if d is not best and "t" not in d.signals) < 0.5


@pytest.mark.slow
@pytest.mark.sample
def test_a_torque_beneath_the_noise_is_told_where_it_is_certain(whole):
    """Bumps that a spindle runs over in less than a sample: a third of what is missing."""
    case = sample("torque_bumps", 127306)
    fitted = begin(record_of(case), model_of(case), None, 1.0, quiet).base
    missing = hidden_in_noise(fitted)
    assert missing_function(fitted) is None and missing is not None
    assert missing.signals == ("theta",) and missing.share < 0.5
    assert left_over(fitted, fitted, found=False, doubtful=False) == (True, ("theta",))
    assert left_over(whole, whole, found=False, doubtful=False) == (False, ())


def test_narrow_bumps_hang_on_the_place(plain):
    def bumps(t, theta, w):
        return 1.5 * np.exp(-((np.mod(theta, 2.0 * np.pi) - 2.0) ** 2) / (2.0 * 0.02**2))

    best = while_sliding(refitted(plain, bumps), everywhere=True).of_signals()
    assert best is not None and best.signals == ("theta",) and best.share > 0.8


def test_a_function_that_told_it_better_than_an_effect_is_named(plain, bumpy):
    after = refitted(plain, knocks)  # as if effects had left this of the bumps
    assert while_sliding(after).torque > 0.5 * while_sliding(bumpy).torque
    assert signals_of_the_rest(after, after) == ("t",)
    assert signals_of_the_rest(after, bumpy) == ("theta",)


def test_knocks_hang_on_time_alone(plain):
    sliding = while_sliding(refitted(plain, knocks), everywhere=True)
    assert sliding.of_signals() is None
    best = sliding.of_time()
    assert best is not None and best.signals == ("t",)
    assert sliding.of_moments() == best


def test_knocks_are_noticed(plain, whole):
    knocked = refitted(plain, knocks)
    assert missing_function(knocked) is None and missing_function(knocked, timed=True) is not None
    assert left_over(knocked, knocked, found=False, doubtful=False) == (True, ("t",))
    assert missing_function(whole, timed=True) is None


def test_what_lasts_is_not_a_matter_of_moments(plain):
    for torque in (bump, slider):
        assert while_sliding(refitted(plain, torque), everywhere=True).of_moments() is None


@pytest.mark.slow
def test_friction_that_wanders_hangs_on_time_and_direction(plain, whole):
    fading = while_sliding(refitted(plain, wandering), everywhere=True).of_fading()
    assert fading is not None and fading.signals == ("t", "w") and fading.share > 0.8
    for torque in (bump, hump, slider, rough_patches, knocks):
        assert while_sliding(refitted(plain, torque), everywhere=True).of_fading() is None
    assert while_sliding(whole).of_fading() is None


def test_a_whole_model_lacks_nothing(whole, bumpy):
    assert missing_function(whole) is None
    assert while_sliding(whole).torque < 0.2 * while_sliding(bumpy).torque
    assert max(d.share for d in while_sliding(whole).dependences) < 0.2


def test_a_drive_at_rest_says_nothing(whole):
    where = replace(whole.where, start=whole.where.start[:1])
    assert while_sliding(replace(whole, where=where)).dependences == ()


def test_an_effect_is_to_take_what_is_missing(whole, bumpy):
    missing = missing_function(bumpy)
    assert missing is not None
    assert missing.stays(bumpy) and missing.is_better_than(bumpy)
    assert not missing.stays(whole) and not missing.is_better_than(whole)


def test_what_the_sliding_drive_lacks_is_left_over(whole, bumpy):
    assert left_over(bumpy, bumpy, found=False, doubtful=False) == (True, ("theta",))
    assert left_over(whole, whole, found=False, doubtful=False) == (False, ())
    assert left_over(bumpy, whole, found=True, doubtful=False) == (False, ())
    assert signals_of_the_rest(bumpy, bumpy, doubtful=True) == ("theta",)


def test_friction_builds_up_with_the_motion(whole):
    predictor, values = whole.predictor, whole.values
    building = predictor.torque(values, built_up=True) - predictor.torque(values)
    w = predictor.data.log.w
    away = np.abs(w) > 0.2 * np.max(np.abs(w))
    top = values["Fs"]
    assert np.sqrt(np.mean(building[away] ** 2)) < 0.02 * top
    assert np.max(np.abs(building)) > 0.5 * top  # around a reversal


def test_a_long_record_counts_by_stretches():
    assert np.all(_enough(0)) and np.all(_enough(MOST)) and np.all(_enough(500))
    chosen = _enough(10 * MOST)
    assert MOST <= np.sum(chosen) <= 1.05 * MOST
    assert np.sum(np.diff(chosen.astype(int)) == 1) == BLOCKS - 1


def test_a_share_counts_no_stretch_for_more_than_it_holds():
    most = np.array([1.0, 1.0, 1.0, 1.0])
    assert judged(("w",), np.array([0.5, 0.5, 0.5, 0.5]), most).share == pytest.approx(0.5)
    assert judged(("w",), np.array([-9.0, 1.0, 1.0, 1.0]), most).share == pytest.approx(0.5)
    assert judged(("w",), np.array([9.0, 0.0, 0.0, 0.0]), most).share == pytest.approx(0.25)
    assert judged(("w",), np.zeros(4), np.zeros(4)).share == 0.0


def test_the_clearest_function_is_of_few_signals():
    def one(signals, share, t=9.0):
        return Dependence(tuple(signals.split()), share, t)

    assert clearest([one("theta", 0.4), one("w", 0.6, t=2.0)]) is None
    assert clearest([one("theta", 0.9), one("theta w", 0.95)]) == one("theta", 0.9)
    assert clearest([one("theta", 0.9), one("w", 0.97), one("theta w", 1.0)]) == one("w", 0.97)
    assert clearest([one("theta", 0.9), one("theta", 0.98)]) == one("theta", 0.98)
    assert clearest([one("theta", 0.6), one("theta w", 0.95)]) == one("theta w", 0.95)
    for share, told in ((0.9, False), (0.97, True)):
        fought = replace(one("a", share), answers=True)
        assert (clearest([fought]) == fought) is told

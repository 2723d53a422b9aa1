"""Stability is Nyquist's, and each margin that of its definition, in every kind of loop."""

import math

import control as ct
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import lugrectl as lg
from lugrectl.core.errors import InputError
from lugrectl.linear.transfer import read_transfer

P = lg.table1()
STEPS = np.geomspace(1e-4, 1e5, 40001)
RESONANT = ct.tf([2.0, 20.0], [1.0, 1.0, 50.0, 0.0])


def test_a_triple_lag_is_its_closed_form():
    """K/(s + 1)^3: Im L = 0 at w = sqrt(3), where (1 + jw)^3 = -8."""
    found = lg.stability_check(ct.tf([2.0], [1.0, 3.0, 3.0, 1.0]))
    assert found.gain_margin == pytest.approx(4.0, rel=1e-12)
    assert found.gain_margin_frequency == pytest.approx(math.sqrt(3), rel=1e-12)
    assert found.gain_range == (0.0, found.gain_margin)
    w = math.sqrt(2 ** (2 / 3) - 1)
    assert found.phase_margin == pytest.approx(180 - 3 * math.degrees(math.atan(w)), rel=1e-12)
    assert found.delay_margin == pytest.approx(math.radians(found.phase_margin) / w, rel=1e-12)


def test_an_unstable_plant_is_encircled_and_needs_a_least_gain():
    """2/(s - 1): a factor above 1/2, and a dead time below arccos(1/2)/sqrt(3)."""
    L = ct.tf([2.0], [1.0, -1.0])
    margin = (math.pi / 3) / math.sqrt(3)
    found = lg.stability_check(L)
    assert found and found.delay_margin == pytest.approx(margin, rel=1e-9)
    assert found.gain_range == (0.5, math.inf)
    assert (found.gain_margin, found.gain_margin_frequency) == (0.5, 0.0)
    assert (found.encirclements, found.open_poles, found.closed_poles) == (1, 1, 0)
    late = lg.stability_check(lg.delayed(L, 1.01 * margin))
    assert not late and (late.encirclements, late.closed_poles) == (-1, 2)


@pytest.mark.timeout(60)  # of a short dead time the largest value is far above the crossover
@given(st.floats(0.2, 30.0), st.floats(0.0, 3.0))
@example(1.0, 0.01)
@settings(max_examples=8, deadline=None)
def test_a_late_integrator_is_its_closed_form(K, turn):
    """K exp(-s T)/s: stable below K T = pi/2, with the gain margin pi/(2 K T), at pi/(2 T)."""
    found = lg.stability_check(lg.delayed(ct.tf([K], [1.0, 0.0]), turn / K))
    assert bool(found) == (turn < math.pi / 2)
    assert found.crossovers == pytest.approx((K,), rel=1e-12)
    if found:
        assert found.delay_margin == pytest.approx((math.pi / 2 - turn) / K, rel=1e-9)
        assert found.phase_margin == pytest.approx(90 - math.degrees(turn), rel=1e-9)
    if not 0.1 < turn < 1.4:
        return
    assert found.gain_margin == pytest.approx(math.pi / (2 * turn), rel=1e-9)
    assert found.gain_margin_frequency == pytest.approx(math.pi * K / (2 * turn), rel=1e-9)

    def distance(w):
        return np.abs(1 + K * np.exp(-1j * w * turn / K) / (1j * w))

    near = STEPS[np.argmin(distance(STEPS * K))] * K
    least = np.min(distance(near * np.linspace(0.999, 1.001, 2001)))
    assert found.modulus_margin <= least * (1 + 1e-12)
    assert found.modulus_margin == pytest.approx(least, rel=1e-5)


def test_of_all_turns_of_a_dead_time_the_largest_decides():
    """The resonance lies at a later turn of the phase than the first crossing."""
    L = lg.delayed(ct.tf([1.0], [1.0, 0.0]) * (1 + ct.tf([60.0, 0.0], [1.0, 2.0, 1e4])), 0.0785)
    found = lg.stability_check(L)
    assert found and found.gain_margin_frequency > 90
    for share in (0.999, 1.001):
        assert bool(lg.stability_check(L * (share * found.gain_margin))) == (share < 1)


@pytest.mark.parametrize("late", [0.0, 0.05])
@pytest.mark.parametrize("share", [0.999, 1.001])
def test_each_margin_is_where_the_loop_becomes_unstable(late, share):
    L = lg.delayed(RESONANT, late)
    found = lg.stability_check(L)
    assert bool(lg.stability_check(L * (share * found.gain_margin))) == (share < 1)
    assert bool(lg.stability_check(lg.delayed(L, share * found.delay_margin))) == (share < 1)
    assert found.modulus_margin * found.Ms == pytest.approx(1.0)


def test_a_sampled_loop_stands_its_factor_and_its_samples():
    dt, many = 0.02, 4
    late = ct.tf([1.0], [1.0] + [0.0] * many, dt)
    L = ct.tf([60 / 4096, 56 / 4096], [1.0, -1.8125, 0.8125], dt) * late  # 8/(s (0.1 s + 1))
    found = lg.stability_check(L)
    for share in (0.999, 1.001):
        assert bool(lg.stability_check(L * (share * found.gain_margin))) == (share < 1)
    stands = int(found.delay_margin / dt)
    for k in (stands, stands + 1):
        more = ct.tf([1.0], [1.0] + [0.0] * k, dt)
        assert bool(lg.stability_check(L * more)) == (k == stands)
    w = np.linspace(1e-4, math.pi, 100001) / dt
    away = np.abs(
        1 + np.divide(*(np.polyval(x[0][0], np.exp(1j * w * dt)) for x in (L.num, L.den)))
    )
    assert found.modulus_margin == pytest.approx(away.min(), rel=1e-6)
    assert found.modulus_margin_frequency == pytest.approx(w[away.argmin()], rel=1e-3)


def test_half_the_sampling_rate_counts():
    """0.9/(z - 0.1): L(-1) = -0.9/1.1, which no phase crossing below half the rate shows."""
    found = lg.stability_check(ct.tf([0.9], [1.0, -0.1], 0.1))
    assert found.gain_margin == pytest.approx(1.1 / 0.9, rel=1e-12)
    assert found.gain_margin_frequency == pytest.approx(math.pi / 0.1)
    assert found.modulus_margin == pytest.approx(1 - 0.9 / 1.1, rel=1e-12)
    direct = lg.stability_check(ct.tf([-0.5, 0.5], [1.0, 0.0], 0.1))  # |L(-1)| = 1
    assert not direct and "unit circle" in direct.reason


def test_a_measured_loop_has_the_margins_of_its_system():
    w = np.geomspace(1e-2, 1e3, 3000)
    found, true = (lg.stability_check(L) for L in (ct.frd(RESONANT, w), RESONANT))
    assert found and "if L has no poles right of the axis" in found.reason
    for margin in ("phase_margin", "delay_margin", "modulus_margin"):
        for key in (margin, f"{margin}_frequency"):
            assert getattr(found, key) == pytest.approx(getattr(true, key), rel=1e-3)
    late = lg.stability_check(lg.delayed(ct.frd(RESONANT, w), 0.05))
    true = lg.stability_check(lg.delayed(RESONANT, 0.05))
    assert late.gain_margin == pytest.approx(true.gain_margin, rel=1e-3)


@pytest.mark.parametrize("den", [[1.0, 3.0, 3.0, 1.0], [1.0, 1.0, 0.0], [1.0, 0.5, 0.0, 0.0]])
def test_nyquist_counts_the_poles_of_a_measured_loop(den):
    L = ct.tf([8.0], den)
    found = lg.stability_check(ct.frd(L, np.geomspace(1e-3, 1e2, 500)))
    assert found.closed_poles == np.sum(ct.feedback(L).poles().real > 0)


def test_the_poles_of_a_measured_unstable_plant_are_declared():
    F = ct.frd(ct.tf([2.0], [1.0, -1.0]), np.geomspace(1e-3, 1e2, 500))
    assert not lg.stability_check(F) and lg.stability_check(F, open_poles=1)
    assert lg.stability_check(F, open_poles=1).encirclements == 1


def test_a_measured_loop_that_ends_above_1_is_not_decided():
    found = lg.stability_check(ct.frd(ct.tf([50.0], [1.0, 1.0]), [0.1, 1.0, 10.0]))
    assert not found and "not decided" in found.reason and math.isnan(found.modulus_margin)


def test_a_measured_loop_that_is_negative_at_low_frequency_has_its_factor_there():
    """-0.5/(s + 1) is stable for factors below 2."""
    F = ct.frd(ct.tf([-0.5], [1.0, 1.0]), np.geomspace(1e-4, 1e3, 500))
    found = lg.stability_check(F)
    assert found.gain_margin == pytest.approx(2.0) and found.gain_margin_frequency == 0.0
    assert found.stable_gains == ((0.0, pytest.approx(2.0)),)
    raised = lg.stability_check(4 * F)
    assert not raised and raised.stable_gains == ((0.0, pytest.approx(0.5)),)


@pytest.mark.cases
@pytest.mark.parametrize("seed", [0, 5])  # with and without an integrator
def test_many_states_have_the_margins_of_exact_arithmetic(seed):
    random = np.random.default_rng(seed)
    A = random.normal(size=(8, 8))
    A = A - (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(8)
    B, C = random.normal(size=(2, 8))
    L = ct.ss(A, B[:, None], 0.3 * C[None], 0.2 * (seed % 3 - 1))
    L = L * ct.ss([[0.0 if seed % 2 else 0.2]], 1.0, 1.0, 0.5)  # an integrator, or not stable
    num, den = read_transfer(L)
    found, exact = lg.stability_check(L), lg.stability_check((num[::-1], den[::-1]))
    assert L.nstates == 9 and (found.stable, found.closed_poles) == (
        exact.stable,
        exact.closed_poles,
    )
    for name in ("gain_range", "crossovers", "delay_margin", "phase_margin", "modulus_margin"):
        wanted = pytest.approx(getattr(exact, name), rel=1e-6, nan_ok=True)
        assert getattr(found, name) == wanted, name


def test_beyond_the_band_the_gain_margin_is_a_least_one():
    """The phase of this loop crosses -180 deg at 773 rad/s, above what was measured."""
    w = np.geomspace(1.0, 600.0, 400)
    L = (0.25 + 6 / (1j * w)) / (0.002j * w + 0.01) * np.exp(-0.002j * w)
    found = lg.stability_check(ct.frd(L, w))
    assert found.gain_margin == pytest.approx(1 / abs(L[-1]))
    assert found.gain_margin_frequency == pytest.approx(600.0)
    assert found.stable_gains == ((0.0, pytest.approx(found.gain_margin)),)
    assert "at least 4.796 if |L| stays below its last value" in found.reason


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["exact", "floating", "measured", "late"])
def test_disk_margins_are_those_of_their_definition(kind):
    w = np.geomspace(1e-3, 1e3, 3000)
    two = ct.ss([[0.0, 1.0], [-0.2, -0.3]], [[0.0], [1.0]], [[1.0, 0.2]], 0.0)
    seven = ct.ss(-np.eye(7), np.ones((7, 1)), np.ones((1, 7)) / 7, 0.0)
    late = lg.delayed(ct.tf([1.0], [1.0, 1.0, 0.0]), 0.3)
    given = {"exact": RESONANT, "floating": 0.1 * two * seven, "late": late}
    L = given.get(kind, ct.frd(RESONANT, w))
    values = np.array([given.get(kind, RESONANT)(1j * x) for x in w])
    found = lg.stability_check(L)
    assert found.stable
    for skew, margin in zip((1, -1, 0), found.disk_margins, strict=True):
        grid = 1 / np.abs(1 / (1 + values) + (skew - 1) / 2).max()
        assert margin == pytest.approx(grid, rel=2e-3)
        if kind == "exact":
            assert margin == pytest.approx(ct.disk_margins(L, w, skew=skew)[0], rel=2e-3)


@pytest.mark.parametrize("seed", range(6))
def test_stable_gains_are_all_there_are(seed):
    """Against the poles of the closed loop over gains; a third has many states, one is sampled."""
    random = np.random.default_rng(seed)
    num, den = random.normal(size=random.integers(1, 4)), random.normal(size=4)
    L = ct.ss(ct.tf(num, den))
    if seed % 3 == 1:
        L = L * ct.ss(-np.eye(7), np.ones((7, 1)), np.ones((1, 7)) / 7, 0.0)
    if seed % 3 == 2:
        L = ct.sample_system(L, 0.3)
    found = lg.stability_check(L)
    for k in np.geomspace(1e-3, 1e3, 61):
        if any(abs(k / end - 1) < 1e-3 for one in found.stable_gains for end in one if end):
            continue
        poles = np.linalg.eigvals(L.A - k / (1 + k * L.D[0, 0]) * L.B @ L.C)
        stable = bool((np.abs(poles) < 1).all() if L.dt else (poles.real < 0).all())
        assert stable == any(low < k < high for low, high in found.stable_gains), k


def test_an_unstable_loop_says_which_gains_would_do():
    raised = lg.stability_check(ct.tf([0.5], [1.0, -1.0]))
    assert not raised and raised.stable_gains == ((2.0, math.inf),)
    assert raised.reason.endswith("with L times 2 to inf it is")
    assert lg.stability_check(ct.tf([1.0], [1.0, -1.0, 1.0, 0.0])).stable_gains == ()


def test_a_closed_loop_that_was_handed_in_is_told():
    closed, said = ct.tf([10.0], [1.0, 2.0, 10.0]), "the open loop is asked for"
    w = np.geomspace(0.01, 1e3, 300)
    seven = ct.ss(-np.eye(9), np.ones((9, 1)), np.ones((1, 9)) / 9, 0.0)
    for L in (closed, ct.frd(closed, w), lg.delayed(closed, 0.01), seven):
        assert said in lg.stability_check(L).reason
    for L in (1.1 * closed, ct.frd(1.1 * closed, w), RESONANT):
        assert said not in lg.stability_check(L).reason


def test_a_loop_below_1_stands_any_dead_time():
    found = lg.stability_check(lg.delayed(ct.tf([0.5], [1.0, 1.0]), 3.0))
    assert found and found.delay_margin == found.phase_margin == math.inf


def test_a_direct_path_of_1_or_more_stands_none():
    L = ct.tf([2.0, 1.0], [1.0, 3.0])
    found = lg.stability_check(L)
    assert found and found.delay_margin == 0.0
    assert lg.stability_check(lg.delayed(ct.tf([0.5, 1.0], [1.0, 3.0]), 0.5))


def test_a_late_direct_path_of_1_or_more_is_told():
    late = lg.stability_check(lg.delayed(ct.tf([2.0, 1.0], [1.0, 3.0]), 1e-6))
    assert not late and late.closed_poles == math.inf and "infinitely many" in late.reason


def test_a_mode_that_cancels_is_not_forgotten():
    L = lg.delayed(ct.tf([1.0], [1.0, -2.0]), 0.1) * ct.tf([1.0, -2.0], [1.0, 3.0])
    found = lg.stability_check(L)
    assert not found and "s = +2" in found.reason


def test_two_dead_times_are_counted_too():
    """A Smith predictor: the loop is that without dead time, whatever the dead time."""
    G, C = ct.tf([1.0], [1.0, 0.5]), ct.tf([8.0, 40.0], [1.0, 0.0])
    inner = lg.delayed(C, 0.0).feedback(G - lg.delayed(G, 0.4))
    found = lg.stability_check(inner * lg.delayed(G, 0.4))
    assert found and 0 < found.delay_margin < 0.4
    assert not lg.stability_check(lg.delayed(C * G, 0.4))


def test_wrong_loops_are_named():
    with pytest.raises(InputError, match="is for a measured response"):
        lg.stability_check(ct.tf([1.0], [1.0, 0.5], 0.1), open_poles=1)
    with pytest.raises(InputError, match="open_poles must be .* 0.5"):
        lg.stability_check(ct.frd(ct.tf([1.0], [1.0, 0.5]), [0.1, 1.0]), open_poles=0.5)
    with pytest.raises(InputError, match="no solution"):
        lg.stability_check(ct.tf([-1.0], [1.0]))
    with pytest.raises(InputError, match="dead_time"):
        lg.velocity_L(P, kp=1.0, dead_time=-1e-3)

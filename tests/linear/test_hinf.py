"""The H-infinity norm of any linear system against an independent dense maximisation."""

from __future__ import annotations

import math

import control as ct
import numpy as np
import pytest

import lugrectl as lg


def draw(rng, sampled):
    """A random stable system of 1 to 12 states; half of them lightly damped."""
    n = int(rng.integers(1, 13))
    A = rng.standard_normal((n, n))
    least = 10.0 ** rng.uniform(-4, 0)
    if sampled:
        A *= math.exp(-least) / np.abs(np.linalg.eigvals(A)).max()
    else:
        A -= (np.linalg.eigvals(A).real.max() + least) * np.eye(n)
        A *= 10.0 ** rng.uniform(-2, 2)
    D = rng.choice([0.0, rng.standard_normal()])
    return ct.ss(A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), D, sampled)


def maximised(T):
    """The largest |T|: a dense grid, finer about each pole; then its best places, zoomed in."""
    poles = np.linalg.eigvals(T.A)
    if T.dt:
        poles = np.log(poles.astype(complex))
    steps = np.concatenate([[0], np.geomspace(0.01, 100, 60)])
    near = np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * np.append(-steps, steps)
    size = np.abs(poles).max()
    grid = np.concatenate([[0.0], np.geomspace(1e-6 * size, 1e3 * size, 3000), near.ravel()])
    grid = np.unique(grid[grid >= 0])
    grid = np.append(grid[grid < np.pi], np.pi) if T.dt else grid

    values = response(T, grid)
    peaks = np.flatnonzero(
        (values >= np.append(values[1:], 0)) & (values >= np.append(0, values[:-1]))
    )
    best = abs(T.D[0, 0]) if not T.dt else 0.0
    for k in sorted(peaks, key=lambda k: -values[k])[:6]:
        low, high = grid[max(k - 1, 0)], grid[min(k + 1, len(grid) - 1)]
        for _ in range(9):
            w = np.linspace(low, high, 41)
            found = response(T, w)
            j = int(np.argmax(found))
            low, high = w[max(j - 1, 0)], w[min(j + 1, 40)]
            best = max(best, found[j])
    return best


def response(T, w):
    s = np.exp(1j * w) if T.dt else 1j * w
    A = s[:, None, None] * np.eye(T.nstates) - T.A
    return np.abs(
        (T.C @ np.linalg.solve(A, np.broadcast_to(T.B, (len(w), *T.B.shape))) + T.D)[:, 0, 0]
    )


def test_the_norm_is_that_of_an_independent_dense_maximisation():
    rng = np.random.default_rng(1)
    for k in range(40):
        T = draw(rng, bool(k % 2))
        found, wanted = lg.l2_check(T), maximised(T)
        assert found.gain == pytest.approx(wanted, rel=1e-9), (k, T)
        if math.isfinite(found.frequency):
            at = response(T, np.array([found.frequency]))[0]
            assert at == pytest.approx(found.gain, rel=1e-9)


@pytest.mark.parametrize("dt", [0, True])
def test_several_channels_have_the_largest_singular_value(dt):
    rng = np.random.default_rng(5)
    A = rng.standard_normal((9, 9))
    A = 0.95 * A / np.abs(np.linalg.eigvals(A)).max() - (0 if dt else 1.0) * np.eye(9)
    T = ct.ss(A, rng.standard_normal((9, 2)), rng.standard_normal((3, 9)), 0, dt)
    w = np.linspace(0, math.pi if dt else 20, 4001)
    s = np.exp(1j * w) if dt else 1j * w
    swept = np.linalg.norm(np.moveaxis(T(s), -1, 0), 2, axis=(1, 2)).max()
    found = lg.l2_check(T)
    assert swept * (1 - 1e-12) <= found.gain <= swept * (1 + 1e-4)
    assert "singular value" in found.reason


@pytest.mark.parametrize("dt", [0, True])
def test_a_hidden_mode_on_the_border_leaves_the_gain_and_one_beyond_it_does_not(dt):
    """Of many states as of few."""
    border, beyond = (1.0, 1.5) if dt else (0.0, 0.5)
    for few in (0, 6):
        own = ct.ss([[0.5 if dt else -1.0]], [[1.0]], [[1.0]], 0, dt)
        more = [ct.ss(0.1 if dt else -2.0, 1, 1, 0, dt)] * few
        for hidden, finite in ((border, True), (beyond, False)):
            T = ct.append(own, *more, ct.ss(hidden, 1, 1, 0, dt))
            found = lg.l2_check(ct.ss(T.A, T.B[:, :1], T.C[:1], T.D[:1, :1], dt))
            assert bool(found) == finite and "not stable" in found.reason
            assert found.gain == pytest.approx((2.0 if dt else 1.0) if finite else math.inf)


def test_a_system_that_is_not_stable_has_no_gain_and_names_its_pole():
    A = np.diag([-1.0, -2.0, -3.0, -4.0, -5.0, -6.0, 0.5])
    T = ct.ss(A, np.ones((7, 1)), np.ones((1, 7)), 0)
    found = lg.l2_check(T)
    assert not found and "rightmost pole is +0.5 1/s" in found.reason
    T = ct.ss(A / 4, np.ones((7, 1)), np.ones((1, 7)), 0, 0.1)
    assert not lg.l2_check(T) and "largest pole is z = -1.5" in lg.l2_check(T).reason
    assert not lg.l2_check(ct.tf([1], [1, -1.5], 0.1))


def slow_beside_fast(slow, fast, n):
    """slow/(s + slow) in front of n - 1 lags: the poles stand on the diagonal, the gain is 1."""
    T = ct.ss(-slow, slow, 1.0, 0.0)
    for k in range(n - 1):
        T = T * ct.ss(-fast * (1 + 0.1 * k), 1.0, fast * (1 + 0.1 * k), 0.0)
    return T


@pytest.mark.parametrize(("slow", "fast", "n"), [(1e-6, 1e6, 7), (1e-8, 1e5, 9)])
def test_a_pole_within_rounding_of_the_axis_is_decided_exactly(slow, fast, n):
    assert lg.l2_check(slow_beside_fast(slow, fast, n)).gain == pytest.approx(1.0)
    unstable = lg.l2_check(slow_beside_fast(-slow, fast, n))
    assert unstable.gain == math.inf and "not stable" in unstable.reason


def test_where_stability_is_not_decided_this_is_said():
    said = lg.l2_check(slow_beside_fast(1e-6, 1e6, 18)).reason
    assert "whether the system is stable is within rounding" in said


def test_modes_of_nearly_no_damping_have_their_peak():
    w, z = 10.0 ** np.arange(4), 1e-9
    T = ct.ss([[-2 * z * w[0], -w[0]], [w[0], 0.0]], [[w[0]], [0.0]], [[0.0, 1.0]], 0.0)
    for k in w[1:]:
        T = T + ct.ss([[-2 * z * k, -k], [k, 0.0]], [[1e-3 * k], [0.0]], [[0.0, 1.0]], 0.0)
    assert lg.l2_check(T).gain == pytest.approx(0.5 / z, rel=1e-6)

"""What an unknown smooth torque adds to intervals: nothing where there is none, else enough."""

import numpy as np

from lugrectl.identification.unknown_torque.discrepancy import Motion, Rows, discrepancy

RNG = np.random.default_rng(4)
ROWS = 3000
T = np.linspace(0.0, 30.0, ROWS)
THETA = 2.0 * np.sin(0.9 * T) + 1.3 * np.sin(2.3 * T + 1.0)
W = np.gradient(THETA, T)
A = np.gradient(W, T)
X = np.column_stack([A, np.sign(W), W])
TRUE = np.array([0.02, 0.3, 0.05])
NOISE = 0.01
SIGNALS = Motion(T, THETA, W, X @ TRUE, "rotary")


def fitted(torque):
    """Values of a regression of noisy torque, their covariance and what is added to it."""
    y = X @ TRUE + torque + NOISE * RNG.standard_normal(ROWS)
    H = X.T @ X / NOISE**2
    p = np.linalg.solve(H, X.T @ y / NOISE**2)
    r = (y - X @ p) / NOISE**2
    rows = Rows(r, X.T / NOISE**2, np.full(ROWS, NOISE**-2))
    return p, np.linalg.inv(H), discrepancy(H, np.zeros(3), rows, SIGNALS.functions())


def test_nothing_is_added_where_the_residual_is_noise():
    added = [np.sqrt(np.diag(more) / np.diag(own)) for _, own, more in [fitted(0.0)] * 5]
    assert np.max(added) < 0.5


def test_intervals_hold_the_truth_beside_an_unknown_torque():
    held = {"without": [], "with": []}
    for _ in range(40):
        centre, size = RNG.uniform(-2.0, 2.0), RNG.choice([-1, 1]) * RNG.uniform(0.02, 0.06)
        kind = RNG.integers(3)
        of = (THETA, W, 0.2 * (T - 15.0))[kind]
        p, own, more = fitted(size * np.exp(-((of - centre) ** 2)))
        for name, V in (("without", own), ("with", own + more)):
            held[name].append(np.abs(p - TRUE) < 1.96 * np.sqrt(np.diag(V)))
    assert np.mean(held["without"]) < 0.7
    assert np.mean(held["with"]) > 0.85


def test_what_is_added_is_a_covariance_as_large_as_the_torque_allows():
    _, own, more = fitted(0.05 * np.sin(2.0 * W))
    size = np.sqrt(np.diag(own))
    assert np.all(np.linalg.eigvalsh(more / np.outer(size, size)) > -1e-6)
    assert 3.0 * size[1] < np.sqrt(more[1, 1]) < 0.1


def test_a_signal_that_is_missing_or_dead_adds_nothing_of_its_own():
    still = Motion(T, np.zeros(ROWS), W, np.zeros(ROWS), "rotary")
    H = X.T @ X / NOISE**2
    noise = NOISE * RNG.standard_normal(ROWS)
    r = noise - X @ np.linalg.lstsq(X, noise, rcond=None)[0]
    rows = Rows(r / NOISE**2, X.T / NOISE**2, np.full(ROWS, NOISE**-2))
    more = discrepancy(H, np.zeros(3), rows, still.functions())
    assert np.all(np.isfinite(more)) and np.all(np.diag(more) < np.diag(np.linalg.inv(H)))

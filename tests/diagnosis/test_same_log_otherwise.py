"""The way a log is written changes nothing of an answer."""

import numpy as np
import pytest

import lugrectl as lg


def oil(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """A mass in oil, exactly: J dw/dt = u - Fv w, u held."""
    J, Fv, dt, n = 2e-3, 0.02, 4e-3, 3000
    t = np.arange(n) * dt
    u = 0.3 * np.sin(4.4 * t) + 0.15 * np.sin(14.5 * t + 1.0) + 0.1 * np.sin(44.0 * t)
    w, theta, still = np.zeros(n), np.zeros(n), np.exp(-Fv * dt / J)
    for k in range(n - 1):
        end = u[k] / Fv
        w[k + 1] = end + (w[k] - end) * still
        theta[k + 1] = theta[k] + end * dt + (w[k] - w[k + 1]) * J / Fv
    w, theta = w + 1e-2 * rng.standard_normal(n), theta + 1e-4 * rng.standard_normal(n)
    return {"t": t, "u": u, "w": w, "theta": theta}


def written(folder, log, head=None, order=None):
    order = order or list(log)
    lines = [",".join((head or {}).get(k, k) for k in order)]
    rows = zip(*(log[k] for k in order), strict=True)
    path = folder / "run.csv"
    path.write_text("\n".join([*lines, *(",".join(f"{x:.17g}" for x in row) for row in rows)]))
    return path


DEGREES = {"t": "t [ms]", "u": "u [mN m]", "w": "w [deg/s]", "theta": "theta [deg]"}
FACTOR = {"t": 1e3, "u": 1e3, "w": 180.0 / np.pi, "theta": 180.0 / np.pi}
CHANGES = {
    "units": lambda log: {k: x * FACTOR[k] for k, x in log.items()},
    "order": lambda log: {k: log[k] for k in ("theta", "w", "u", "t")},
    "origin": lambda log: log | {"t": log["t"] + 1e6},
    "signs": lambda log: log | {k: -log[k] for k in ("u", "w", "theta")},
    "tenth digit": lambda log: {k: x if k == "t" else x * (1.0 + 1e-10) for k, x in log.items()},
}


@pytest.mark.cases
@pytest.mark.parametrize("what", CHANGES)
def test_the_way_a_log_is_written_changes_nothing(tmp_path, what):
    log, model = oil(np.random.default_rng(1)), lg.Model.of(friction="viscous", J=2.1e-3)
    usual = lg.identify(written(tmp_path, log), model)
    head = DEGREES if what == "units" else None
    other = lg.identify(written(tmp_path, CHANGES[what](log), head), model)
    for key in ("J", "Fv"):
        width = np.ptp(usual.estimates[key].ci95)
        assert other.estimates[key].value == pytest.approx(
            usual.estimates[key].value, abs=0.02 * width
        )
        assert np.ptp(other.estimates[key].ci95) == pytest.approx(width, rel=0.02)
    assert other.error["refitted"] == pytest.approx(usual.error["refitted"], rel=1e-3)

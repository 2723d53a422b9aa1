"""Ways in which a log comes out wrong, each on a sound one; the truth stays as it was."""

from __future__ import annotations

import numpy as np

__all__ = ["DAMAGES", "damage"]


def damage(log: dict, kind: str, seed: int = 0) -> dict:
    """A copy of the log with a damage of this kind (of DAMAGES).

    Raises KeyError for a kind that does not exist, and ValueError where the log has no column
    that could be damaged so.
    """
    rng = np.random.default_rng([seed, list(DAMAGES).index(kind)])
    copy = {k: np.array(v, float) for k, v in log.items()}
    return DAMAGES[kind](copy, rng)


def _need(log, name):
    if name not in log:
        raise ValueError(f"the log has no {name}")
    return log[name]


def _outliers(name, count):
    def kind(log, rng):
        x = _need(log, name)
        at = rng.choice(len(x), count, replace=False)
        x[at] += rng.choice([-1, 1], count) * rng.uniform(0.5, 5.0, count) * np.ptp(x)
        return log

    return kind


def _somewhere(log, rng, seconds):
    """A slice of so many seconds, away from the ends."""
    t = log["t"]
    n = max(int(seconds / (t[1] - t[0])), 2)
    start = int(rng.integers(len(t) // 10, len(t) * 9 // 10 - n))
    return slice(start, start + n)


def _column(log, rng):
    return str(rng.choice([k for k in ("u", "theta", "w") if k in log]))


def _largest_number(log, rng):
    x = log[_column(log, rng)]
    x[rng.choice(len(x), 5, replace=False)] = np.finfo(float).max * rng.choice([-1, 1], 5)
    return log


def _nan_runs(log, rng):
    for name in [k for k in log if k != "t"]:
        for _ in range(int(rng.integers(1, 4))):
            log[name][_somewhere(log, rng, rng.uniform(0.01, 1.0))] = np.nan
    return log


def _stuck(log, rng):
    x, at = log[_column(log, rng)], _somewhere(log, rng, rng.uniform(0.5, 2.0))
    x[at] = x[at.start]
    return log


def _zeroed(log, rng):
    """The column gives 0 for a second or two."""
    log[_column(log, rng)][_somewhere(log, rng, rng.uniform(0.5, 2.0))] = 0.0
    return log


def _zero_filled(log, rng):
    """No answer came: 0 in single rows, in up to a fifth of all."""
    x = log["u" if "w" not in log else str(rng.choice(["u", "w"]))]
    x[rng.random(len(x)) < rng.choice([0.02, 0.05, 0.2])] = 0.0
    return log


def _rows(log, keep):
    return {k: v[keep] for k, v in log.items()}


def _same_stamps(log, rng):
    t = log["t"]
    at = rng.choice(len(t) - 1, len(t) // 50, replace=False) + 1
    t[np.sort(at)] = t[np.sort(at) - 1]
    return log


def _same_rows(log, rng):
    return _rows(log, np.sort(np.r_[np.arange(len(log["t"])), rng.choice(len(log["t"]), 50)]))


def _stamps_jitter(log, rng):
    """The rows are even, what is written as their time is not."""
    t = log["t"]
    log["t"] = t + 0.3 * (t[1] - t[0]) * rng.uniform(-1, 1, len(t))
    return log


def _rows_jitter(log, rng):
    """The rows themselves are uneven, and their stamps say so."""
    t = log["t"]
    at = t + 0.3 * (t[1] - t[0]) * rng.uniform(-1, 1, len(t))
    at = np.sort(at.clip(t[0], t[-1]))
    moved = {k: np.interp(at, t, v) for k, v in log.items() if k != "t"}
    return {"t": at} | moved


def _late_stamps(log, rng):
    """A host stamps rows when they come: late, and several at a time."""
    t = log["t"]
    dt, n = t[1] - t[0], len(t)
    size = int(rng.integers(3, 12))
    arrival = t[np.minimum((np.arange(n) // size + 1) * size, n - 1)]
    late = 2e-3 * rng.standard_gamma(1.0, n // size + 1)[np.arange(n) // size]
    log["t"] = np.maximum.accumulate(arrival + late + 0.02 * dt * (np.arange(n) % size))
    return log


def _lost(noticed):
    def kind(log, rng):
        """Rows are missing here and there, and one stretch of up to a tenth of a second."""
        n, t = len(log["t"]), log["t"]
        keep = rng.random(n) > (0.02 if noticed else 5.0 / n)
        if noticed:
            keep[_somewhere(log, rng, rng.uniform(0.02, 0.1))] = False
        out = _rows(log, keep)
        if not noticed:
            out["t"] = t[: len(out["t"])]
        return out

    return kind


def _pasted(restarts):
    def kind(log, rng):
        """Two runs in one file: what lay between them is gone."""
        t, at = log["t"], _somewhere(log, rng, rng.uniform(1.0, 4.0))
        keep = np.ones(len(t), bool)
        keep[at] = False
        out = _rows(log, keep)
        out["t"] = t[: len(out["t"])].copy()
        if restarts:
            out["t"][at.start :] -= out["t"][at.start]
        return out

    return kind


def _wrapped_angle(log, rng):
    theta = _need(log, "theta")
    if np.ptp(theta) < 7.0:
        raise ValueError("the drive does not turn once")
    log["theta"] = theta % (2 * np.pi)
    return log


def _wrapped_timer(log, rng):
    log["t"] = (log["t"] + rng.uniform(0, 5)) % rng.choice([8.192, 16.0, 65.536 / 4])
    return log


def _clipped(log, rng):
    """The torque register ends before the torque does."""
    limit = np.quantile(abs(log["u"]), rng.uniform(0.93, 0.99))
    log["u"] = log["u"].clip(-limit, limit)
    return log


def _held(log, rng):
    """Written faster than it was sampled."""
    n = int(rng.integers(2, 6))
    at = np.arange(len(log["t"])) // n * n
    return {k: v if k == "t" else v[at] for k, v in log.items()}


def _w_in_rpm_late(log, rng):
    w, t = _need(log, "w"), log["t"]
    log["w"] = np.interp(t - 4e-3, t, w) * 30 / np.pi
    return log


def _flipped(log, rng):
    log["u"][_somewhere(log, rng, 1.0)] *= -1
    return log


def _eight_bit(log, rng):
    step = 2 * abs(log["u"]).max() / 255
    log["u"] = np.round(log["u"] / step) * step
    return log


DAMAGES = {
    **{f"{n}_outliers_{c}": _outliers(c, n) for c in ("u", "theta", "w") for n in (1, 10, 100)},
    "largest_number": _largest_number,
    "nan_runs": _nan_runs,
    "stuck": _stuck,
    "zeroed": _zeroed,
    "zero_filled": _zero_filled,
    "same_stamps": _same_stamps,
    "same_rows": _same_rows,
    "stamps_jitter": _stamps_jitter,
    "rows_jitter": _rows_jitter,
    "late_stamps": _late_stamps,
    "lost_noticed": _lost(True),
    "lost_unnoticed": _lost(False),
    "pasted": _pasted(False),
    "pasted_restart": _pasted(True),
    "wrapped_angle": _wrapped_angle,
    "wrapped_timer": _wrapped_timer,
    "clipped": _clipped,
    "held_rows": _held,
    "w_rpm_late": _w_in_rpm_late,
    "flipped": _flipped,
    "eight_bit": _eight_bit,
}

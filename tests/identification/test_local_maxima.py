"""The fit does not depend on where it starts; other values that are as likely are said."""

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.identification.dataset.windows import windows
from lugrectl.identification.likelihood.local_maxima import other_optima, starts, surest
from lugrectl.identification.likelihood.maximise import Fitted, again

from ..cases.common import begun

TRUE = {"J": 2.2e-3, "sigma0": 300.0, "sigma1": 0.6, "Fc": 0.22, "Fs": 0.3, "Fv": 0.012, "vs": 0.02}
STEP = 2.0 * np.pi / 8192  # rad, of the encoder
DT, FINE = 2e-3, 40


def commands(n: int, rng: np.random.Generator) -> np.ndarray:
    """Speeds to follow: steps of 0.3 s, a third of them to 0."""
    each, speeds = 150, rng.uniform(2.0, 12.0, n)
    ways = rng.choice([0.0, 1.0, -1.0], n // each)
    return np.resize(np.repeat(ways * speeds[: n // each], each), n)


def drive(seed: int = 77, seconds: float = 12.0) -> dict[str, np.ndarray]:
    """A drive with a narrow Stribeck dip that starts and stops quickly, behind an encoder."""
    rng, n, h = np.random.default_rng(seed), round(seconds / DT), DT / FINE
    wanted = commands(n, rng)
    w = theta = z = total = 0.0
    u, angle = np.zeros(n), np.zeros(n)
    for k in range(n):
        angle[k], error = theta, wanted[k] - w
        total = np.clip(total + 2.0 * error * DT, -0.5, 0.5)
        u[k] = np.clip(0.08 * error + total, -0.9, 0.9) + 0.01 * rng.standard_normal()
        for _ in range(FINE):
            level = TRUE["Fc"] + (TRUE["Fs"] - TRUE["Fc"]) * np.exp(-((w / TRUE["vs"]) ** 2))
            rate = TRUE["sigma0"] * abs(w) / level
            dz = (w - rate * z) / (1.0 + h * rate)
            F = TRUE["sigma0"] * z + TRUE["sigma1"] * dz + TRUE["Fv"] * w
            w += h * (u[k] - F) / TRUE["J"]
            z, theta = z + h * dz, theta + h * w
    return {"t": np.arange(n) * DT, "u": u, "theta": np.round(angle / STEP) * STEP}


@pytest.fixture(scope="module")
def base() -> Fitted:
    return begun(lg.read_record(drive()), lg.Model.of(TRUE)).base


@pytest.fixture(scope="module")
def everywhere(base):
    return windows(base.predictor.data.runs, base.where.burn, base.where.length)


@pytest.fixture(scope="module")
def found(base, everywhere) -> Fitted:
    return surest(base, everywhere, ())


def test_the_same_answer_comes_from_values_that_are_far_off(base, everywhere, found):
    wrong = replace(base, values=base.values | {"vs": 0.3, "Fs": 0.24})
    other = surest(wrong, everywhere, ())
    assert other.total == pytest.approx(found.total, abs=2.0)
    ends = found.intervals()
    for key in ("Fs", "vs", "sigma0", "Fc", "J"):
        low, high = ends[key]
        assert low <= other.values[key] <= high, key
        assert other.intervals()[key] == pytest.approx(ends[key], rel=0.6)


def test_the_truth_lies_inside_intervals_as_wide_as_the_record_leaves_them(found):
    ends = found.intervals()
    for key in ("Fc", "Fs", "vs", "sigma0"):
        assert ends[key][0] <= TRUE[key] <= ends[key][1], key
    assert ends["vs"][1] < 0.5


def test_starts_lie_over_decades_and_the_likeliest_come_first(base):
    few = starts(replace(base, values=base.values | {"vs": 0.3, "Fs": 0.24}))
    assert 1 < len(few) <= 3
    assert all(v["Fs"] > v["Fc"] and 1e-3 < v["vs"] < 1.0 for v in few)
    assert all(v["J"] == base.values["J"] for v in few)
    assert 0.3 < few[0]["vs"] / TRUE["vs"] < 3.0


def test_starts_keep_what_is_held_or_bounded(base):
    model = lg.Model.of(
        {**TRUE, "vs": {"value": 0.02, "fixed": True}, "Fs": {"value": 0.3, "max": 0.31}}
    )
    job = begun(lg.read_record(drive(seconds=4.0)), model, "last", 0.3)
    low = job.base.values | {"Fs": 1.01 * job.base.values["Fc"]}
    few = starts(replace(job.base, values=low))
    assert few and {v["vs"] for v in few} == {0.02} and all(v["Fs"] <= 0.31 for v in few)
    held = lg.Model.of(TRUE).fix("vs", "Fs")
    closed = replace(job.base, free=tuple(c for c in job.base.free if c.key not in held.held()))
    assert starts(closed) == []


def test_intervals_do_not_end_where_the_search_ended(found):
    """The search of vs ends a little above its value here; what is known of it is the same."""
    bare = replace(found, others=())
    near = [replace(c, high=1.01 * bare.values[c.key]) if c.key == "vs" else c for c in bare.free]
    closed = replace(bare, free=tuple(near))
    assert closed.intervals() == bare.intervals()


def test_intervals_contain_those_of_other_maxima_and_a_sentence_says_so(found):
    bare = replace(found, others=())
    there = bare.values | {"J": 1.1 * bare.values["J"]}
    both = replace(bare, others=(replace(bare, values=there),))
    low, high = bare.intervals()["J"]
    assert both.intervals()["J"] == pytest.approx((low, 1.1 * high), rel=1e-3)
    said = other_optima(both)
    assert len(said) == 1 and f"J = {there['J']:.3g}" in said[0] and "Fc" not in said[0]
    assert other_optima(bare) == []


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
    "order": lambda log: {k: log[k] for k in ("theta", "w", "u", "t")},
    "origin": lambda log: log | {"t": log["t"] + 1e6},
    "signs": lambda log: log | {k: -log[k] for k in ("u", "w", "theta")},
    "tenth digit": lambda log: {k: x if k == "t" else x * (1.0 + 1e-10) for k, x in log.items()},
    "units": lambda log: {k: x * FACTOR[k] for k, x in log.items()},
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


def test_the_number_of_threads_changes_nothing(base, monkeypatch):
    made = []
    for count in ("1", "2", "3"):
        monkeypatch.setenv("NUMBA_NUM_THREADS", count)
        made.append(again(base, most=3, rough=True).values)
    assert made[0] == made[1] == made[2]


@pytest.mark.cases
@pytest.mark.parametrize("declared", [0.2, 0.22, 0.1])
def test_stiction_declared_below_friction_is_a_start_and_the_run_goes_on(declared):
    model = lg.Model.of({**TRUE, "Fs": declared})
    job = begun(lg.read_record(drive(seconds=4.0)), model, "last", 0.3)
    assert job.base.values["Fs"] >= job.base.values["Fc"]
    assert any("is below Fc" in m for m in job.messages) == (declared < TRUE["Fc"])

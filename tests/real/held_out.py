"""``python -m tests.real.held_out``: torque error on runs that no fit has seen, by set and model.

RMS torque residual over RMS torque on the same samples of unseen runs, in per cent. Every model
is judged on the same smoothed signals: even time grid, zero-phase Butterworth filter of order 4 on
u and on the motion, central differences; samples near standstill and at the ends do not count.
Sets are cut by run, never by sample. EMPS has one run only, so nothing there is unseen.

The model by hand is that of the set's README: its columns, filter, shift, and what it left on
unseen runs where the README says so.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import butter, sosfiltfilt

from lugrectl.blocks.model import Model
from lugrectl.blocks.plant import assemble

from ..scores.judges import THREADS
from .__main__ import DATA, RESULTS
from .page import WIDTH, commit, keep
from .row import Source
from .rows import FIRST_RUNS, OPTIONS, THIRD_RUNS, VOLT

# ---- a run, smoothed --------------------------------------------------------------------


ENDS = 1.0  # periods of the corner frequency that are left out at either end


@dataclass(frozen=True)
class Filter:
    """Step of the grid, s; corner frequency, Hz; least speed that counts, rad/s or m/s."""

    dt: float
    corner: float
    bound: float


@dataclass(frozen=True, eq=False)
class Motion:
    """Smoothed signals (N,); ``use`` marks the samples that count. theta is None without one."""

    t: np.ndarray
    u: np.ndarray
    theta: np.ndarray | None
    w: np.ndarray
    a: np.ndarray
    use: np.ndarray

    def late(self, shift: float) -> np.ndarray:
        """The torque that acts ``shift`` later than it is logged, u(t - shift)."""
        return np.interp(self.t - shift, self.t, self.u)

    def angle(self) -> np.ndarray:
        """theta, or zeros where it was not recorded."""
        return np.zeros_like(self.t) if self.theta is None else self.theta


@dataclass(frozen=True, eq=False)
class Run:
    """A run as the package reads it (``log``) and its smoothed motion."""

    log: Any
    motion: Motion

    @property
    def hold(self) -> float:
        """Half a step of the log, s: a torque that is held acts so much later than its stamp."""
        return 0.5 * float(np.nanmedian(np.diff(self.log.t)))


def motion_of(log: Mapping[str, np.ndarray], by: Filter) -> Motion:
    """The motion of a log with t, u and theta or w. Of both theta is taken: w is often late."""
    t = np.arange(log["t"][0], log["t"][-1], by.dt)
    sos = butter(4, by.corner, fs=1 / by.dt, output="sos")

    def smooth(name: str) -> np.ndarray:
        return sosfiltfilt(sos, np.interp(t, log["t"], log[name]))

    theta = smooth("theta") if "theta" in log else None
    w = smooth("w") if theta is None else np.gradient(theta, by.dt)
    ends = round(ENDS / by.corner / by.dt)
    use = np.abs(w) > by.bound
    use[:ends] = use[len(use) - ends :] = False
    return Motion(t, smooth("u"), theta, w, np.gradient(w, by.dt), use)


def rms(x: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(x))))


# ---- the sets, cut into runs that are fitted and runs that no fit sees --------------------


ROTARY: Mapping[str, Any] = {"motion": "rotary"}
BASIC = ("a", "w", "sign", "1")
SWUNG = (*BASIC, "sin", "cos")
LOADED = (*BASIC, "sin", "load")


@dataclass(frozen=True)
class Cut:
    """Runs that are fitted, runs that are not; ``shift`` of u, s, in the fit by hand.

    ``readme``: share of RMS torque that the README's fit leaves on the unseen runs.
    """

    train: tuple[Source, ...]
    unseen: tuple[Source, ...]
    shift: float = 0.0
    readme: float | None = None


@dataclass(frozen=True)
class Split:
    """A set with its cuts. ``steady``: every run is one point of a friction map."""

    name: str
    cuts: tuple[Cut, ...]
    columns: tuple[str, ...]
    by: Filter
    model: Mapping[str, Any] = field(default_factory=lambda: ROTARY)
    steady: bool = False
    readme: float | None = None

    def files(self) -> list[str]:
        """The files of all its runs."""
        every = (s.file for cut in self.cuts for s in (*cut.train, *cut.unseen))
        return list(dict.fromkeys(every))


def _cut(
    folder: str,
    train: str,
    unseen: str,
    shift: float = 0.0,
    readme: float | None = None,
    options: Mapping[str, Any] | None = None,
) -> Cut:
    def sources(names: str) -> tuple[Source, ...]:
        return tuple(Source(f"{folder}/{n}.csv", options or {}) for n in names.split())

    return Cut(sources(train), sources(unseen), shift, readme)


def _arm(axis: int, columns: tuple[str, ...], ab: float, ba: float) -> Split:
    folder, a, b = "real/kuka-kr300", f"axis{axis}_A", f"axis{axis}_B"
    cuts = (_cut(folder, a, b, readme=ab), _cut(folder, b, a, readme=ba))
    return Split(f"kuka axis {axis}", cuts, columns, Filter(0.004, 12.0, 0.01))


def _each(files: list[str]) -> tuple[Cut, ...]:
    """Each run left out in turn."""
    sources = [Source(file, OPTIONS) for file in files]
    return tuple(Cut(tuple(s for s in sources if s is not one), (one,)) for one in sources)


def _splits() -> list[Split]:
    swing, servo, motor = "real/dfki-pendulum", "real/bam-xl330", "real/odrive-bldc"
    three, four = "kp100_sin_sin kp100_sin_time_square kp100_up_and_down", "kp400_sin_time_square"
    speed = {"columns": {"w": "y"}, "units": {"w": "deg/s"}}
    dfki = (
        _cut(swing, "ddp", "direct_collocation", 0.012, 0.169),
        _cut(swing, "direct_collocation", "ddp", 0.008, 0.133),
    )
    bam = (_cut(servo, three, four, readme=0.187), _cut(servo, four, three, readme=0.192))
    chirp = (_cut(motor, "chirp1 chirp2", "chirp3", readme=0.0183, options=VOLT),)
    step = (_cut(motor, "step1 step2", "step3", readme=0.0025, options=VOLT),)
    rig = (_cut("real/un-dcmotor", "prbs_open_exp", "step_open_exp", 0.030, options=speed),)
    worm, bend = Filter(0.1, 1.0, 0.0), ("w+", "w-", "sign", "1", "bump+", "bump-")
    return [
        _arm(1, BASIC, 0.354, 0.258),
        _arm(2, SWUNG, 0.373, 0.241),
        _arm(3, SWUNG, 0.378, 0.542),
        Split("dfki swings", dfki, SWUNG, Filter(0.002, 8.0, 0.1)),
        Split("bam", bam, LOADED, Filter(0.005, 12.0, 0.1)),
        Split("odrive chirp", chirp, BASIC, Filter(0.0055, 8.0, 1.0)),
        Split("odrive step", step, BASIC, Filter(0.0055, 8.0, 1.0)),
        Split("un open loop", rig, ("a", "w", "1"), Filter(0.02, 4.0, 0.1)),
        Split("screw drive 1", _each(FIRST_RUNS), ("w", "sign", "1"), worm, steady=True),
        Split("screw drive 3", _each(THIRD_RUNS), bend, worm, steady=True, readme=0.036),
    ]


SPLITS = tuple(_splits())


# ---- the torque residual of a model along a measured motion -------------------------------
#
#     residual = J (dw/dt of the model, driven by u along the measured theta and w, minus a)
#
# States of friction and effects follow the motion; each is stepped exactly as if linear in itself.


FINER = 8  # steps for each sample: a load on a spring moves within one
SMALL = 1e-6  # of a state's scale, for its own slope


def residual(model: Model, run: Run) -> np.ndarray:
    """Torque missing from the model at each sample, N m (N,); positive where it drives."""
    delays = [part for part in model.effects if part.block.name == "input_delay"]
    motion = run.motion
    shift = run.hold + sum(float(part.values["delay"] or 0.0) for part in delays)
    rest = replace(model, effects=tuple(p for p in model.effects if p not in delays))
    signals = (motion.t, motion.late(shift), motion.angle(), motion.w)
    fine = np.linspace(0, len(motion.t) - 1, FINER * (len(motion.t) - 1) + 1)
    samples = np.arange(len(motion.t))
    grid = [np.interp(fine, samples, x) for x in signals]
    dw = _acceleration(rest, *grid)[::FINER]
    return float(rest.known()["J"]) * (motion.a - dw)


def _acceleration(
    model: Model, t: np.ndarray, u: np.ndarray, theta: np.ndarray, w: np.ndarray
) -> np.ndarray:
    """dw/dt of the plant at each sample, its other states carried along."""
    block, values = assemble(model), model.known()
    x, dw, dt = _begin(model, u[0], theta[0], w[0]), np.empty(len(t)), t[1] - t[0]

    def rates(k: int, state: np.ndarray) -> np.ndarray:
        """dw/dt and the rates of the states; the outputs F and w come first."""
        made: Any = block(t[k], u[k], 0.0, theta[k], w[k], *state, **values)
        return np.array([float(v) for v in made[2:]])

    for k in range(len(t)):
        dw[k], *slope = rates(k, x)
        slope = np.array(slope)
        x = x + dt * slope * _shares(lambda s, k=k: rates(k, s)[1:], x, slope, dt)
    return dw


def _begin(model: Model, u: float, theta: float, w: float) -> np.ndarray:
    """The states beside theta and w at the first sample, as their blocks say."""
    signals = {"u": u, "theta": theta, "w": w}
    blocks = [model.friction.block, *(part.block for part in model.effects)]
    inside = [block for block in blocks if "sensor" not in block.acts]
    texts = [text for block in inside for text in block.start[: len(block.states)]]
    return np.array([signals[x] if x in signals else float(x) for x in texts])


def _shares(rate: Any, x: np.ndarray, slope: np.ndarray, dt: float) -> np.ndarray:
    """(e^(a dt) - 1) / (a dt) for each state's own slope a: 1 for a state that only adds up."""
    made = np.ones_like(x)
    for i in range(len(x)):
        h = SMALL * (abs(x[i]) + abs(dt * slope[i])) + 1e-12
        moved = x.copy()
        moved[i] += h
        a = min((rate(moved)[i] - slope[i]) / h * dt, 0.0)
        made[i] = np.expm1(a) / a if a < -1e-9 else 1.0
    return made


# ---- models: a function of the training runs gives the residual (N,) of any run -----------


Residual = Callable[[Run], np.ndarray]
BUMP = 2 * np.pi * 5 / 60  # rad/s, width of the low-speed bump of the worm drive's fit by hand


LIFTED = 0.49 * 0.1**2, 0.49 * 9.81 * 0.1  # kg m2, N m: the pendulum of the hobby servo


def load(m: Motion) -> np.ndarray:
    """|torque of the lifted pendulum| sign(w), its inertia and weight as its README has them."""
    inertia, weight = LIFTED
    return np.abs(inertia * m.a + weight * np.sin(m.angle())) * np.sign(m.w)


COLUMNS: Mapping[str, Callable[[Motion], np.ndarray]] = {
    "a": lambda m: m.a,
    "w": lambda m: m.w,
    "w+": lambda m: np.maximum(m.w, 0.0),
    "w-": lambda m: np.minimum(m.w, 0.0),
    "sign": lambda m: np.sign(m.w),
    "1": lambda m: np.ones_like(m.w),
    "sin": lambda m: np.sin(m.angle()),
    "cos": lambda m: np.cos(m.angle()),
    "load": load,
    "bump+": lambda m: np.exp(-((m.w / BUMP) ** 2)) * (m.w > 0),
    "bump-": lambda m: np.exp(-((m.w / BUMP) ** 2)) * (m.w < 0),
}


@dataclass(frozen=True)
class StandIn:
    """The torque itself, where a diagnosis has no model."""

    def __call__(self, run: Run) -> np.ndarray:
        return run.motion.u


def hand(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """Least squares on the columns of the README."""
    names, shift = split.columns, cut.shift
    b = _least_squares(train, names, shift)
    return lambda run: run.motion.late(shift) - _design(run.motion, names) @ b


def _design(m: Motion, names: Sequence[str]) -> np.ndarray:
    return np.column_stack([COLUMNS[name](m) for name in names])


def _least_squares(train: Sequence[Run], names: Sequence[str], shift: float) -> np.ndarray:
    X = np.concatenate([_design(r.motion, names)[r.motion.use] for r in train])
    y = np.concatenate([r.motion.late(shift)[r.motion.use] for r in train])
    size = np.sqrt(np.mean(X**2, axis=0))
    return np.linalg.lstsq(X / size, y, rcond=None)[0] / size


def trees(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """Boosted trees over theta, w and a, on the residual of the diagnosis: no physics."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    first = ours(train, split, cut)

    def features(m: Motion) -> np.ndarray:
        return np.column_stack([m.angle(), m.w, m.a])

    X = np.concatenate([features(r.motion)[r.motion.use] for r in train])
    y = np.concatenate([first(r)[r.motion.use] for r in train])
    forest = HistGradientBoostingRegressor(random_state=0).fit(X, y)
    return lambda run: first(run) - forest.predict(features(run.motion))


def ours(train: Sequence[Run], split: Split, cut: Cut) -> Residual:
    """The model of the package's diagnosis; the torque itself where there is none."""
    import lugrectl as lg

    runs = [run.log for run in train]
    result = lg.diagnose(runs if len(runs) > 1 else runs[0], dict(split.model))
    if result.map is not None:
        curve = result.map.curves["augmented"]
        return lambda run: run.motion.u - np.interp(run.motion.w, result.map.at, curve)
    if result.model is None or None in result.model.values().values():
        return StandIn()
    return lambda run: residual(result.model, run)


MODELS = {"ours": ours, "hand": hand, "trees": trees}


# ---- errors ------------------------------------------------------------------------------


CHANNELS = ("u", "theta", "w")
DEFAULT = ("ours", "hand", "trees")


def run_of(source: Source, data: Path, split: Split) -> Run:
    """A run of a set: as the package reads it, and smoothed; one point if it is steady."""
    from lugrectl.record import read_log

    log = read_log(data / source.file, motion=split.model["motion"], **source.options)
    columns = {"t": log.t, **{k: log.channels[k] for k in CHANNELS if k in log.channels}}
    whole = np.all([np.isfinite(x) for x in columns.values()], axis=0)
    clean = {k: x[whole] for k, x in columns.items()}
    return Run(log, point(clean) if split.steady else motion_of(clean, split.by))


def point(log: Mapping[str, np.ndarray]) -> Motion:
    """Mean torque over mean speed, the first row left out."""
    w, u = (np.array([float(np.mean(log[k][1:]))]) for k in ("w", "u"))
    zero = np.zeros(1)
    return Motion(zero, u, None, w, zero, np.ones(1, bool))


def errors(split: Split, data: Path, models: Sequence[str]) -> dict[str, Any]:
    """For each model the error on the unseen runs of each cut, and over all of them together."""
    runs: dict[str, Run] = {}

    def read(sources: Sequence[Source]) -> list[Run]:
        for source in sources:
            if source.file not in runs:
                runs[source.file] = run_of(source, data, split)
        return [runs[source.file] for source in sources]

    made: dict[str, Any] = {"readme": [cut.readme for cut in split.cuts], "models": {}}
    if split.steady:
        made["readme"] = [split.readme]
    for name in models:
        pairs = [_of_cut(MODELS[name], split, cut, read) for cut in split.cuts]
        every = [_share(*pair) for pair in pairs]
        joined = _share(*(np.concatenate(x) for x in zip(*pairs, strict=True)))
        made["models"][name] = [joined] if split.steady else every
    return made


def _of_cut(model: Any, split: Split, cut: Cut, read: Any) -> tuple[np.ndarray, np.ndarray]:
    """Residual and torque on the samples that count of the unseen runs."""
    of, unseen = model(read(cut.train), split, cut), read(cut.unseen)
    if isinstance(of, StandIn):
        print(f"{split.name}: the diagnosis has no model: nothing is explained", file=sys.stderr)
    residual = np.concatenate([of(run)[run.motion.use] for run in unseen])
    return residual, np.concatenate([run.motion.u[run.motion.use] for run in unseen])


def _share(residual: np.ndarray, torque: np.ndarray) -> float:
    return rms(residual) / rms(torque)


def percent(values: Sequence[float | None]) -> str:
    return " ".join("-" if v is None else f"{100 * v:.2f}" for v in values)


def main(argv: Sequence[str] | None = None) -> int:
    p = argparse.ArgumentParser(prog="python -m tests.real.held_out", description=__doc__)
    p.add_argument("--set", help="sets whose name contains this")
    p.add_argument("--models", default=",".join(DEFAULT), help=f"of {','.join(MODELS)}")
    p.add_argument("--data", type=Path, default=DATA)
    p.add_argument("--keep", nargs="?", type=Path, const=RESULTS, metavar="FILE")
    args = p.parse_args(argv)
    os.environ |= dict.fromkeys(THREADS, "1")
    models = args.models.split(",")
    print(f"{'set':{WIDTH}s} {'README':>14s} " + " ".join(f"{m:>14s}" for m in models))
    kept = {}
    for split in SPLITS:
        if args.set and args.set not in split.name:
            continue
        missing = [f for f in split.files() if not (args.data / f).is_file()]
        if missing:
            print(f"{split.name:{WIDTH}s} left out: {args.data / missing[0]} is not there")
            continue
        made = kept[split.name] = errors(split, args.data, models)
        cells = [percent(made["readme"]), *(percent(made["models"][m]) for m in models)]
        print(f"{split.name:{WIDTH}s} " + " ".join(f"{c:>14s}" for c in cells), flush=True)
    if args.keep:
        keep(args.keep, "held_out", {"commit": commit(), "sets": kept})
    return 0


if __name__ == "__main__":
    sys.exit(main())

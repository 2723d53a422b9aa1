"""Made-up diagnoses to render."""

import math
from dataclasses import replace

import numpy as np

from lugrectl.blocks.model import Model, table1
from lugrectl.core.errors import Refused
from lugrectl.diagnosis.result import Diagnosis, refusal
from lugrectl.estimates.findings import (
    Candidate,
    Compared,
    Comparison,
    Estimate,
    Finding,
    Share,
    Traces,
)
from lugrectl.record import Record, record_of

HOSTILE = '<script src="http://x.y/z.js">alert(1)</script> & "q".csv'
A, N, PHI = 0.05, 8.0, -1.0


def traces(n=12000, dt=1e-3, seed=1):
    """A ripple in the residual; every other 2 s held out, worst around t = 6.5 s."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * dt
    theta = 5.0 * np.sin(0.4 * np.pi * t)
    w = 2.0 * np.pi * np.cos(0.4 * np.pi * t)
    ripple = A * np.sin(N * theta + PHI)
    held = t // 2.0 % 2 == 1
    worse = 1.0 + 3.0 * (abs(t - 6.8) < 0.5)
    noise = rng.normal(0.0, 0.01, (3, n))
    return Traces(
        t=t,
        measured=w + noise[0],
        held_out=held,
        simulated={
            "refitted": np.where(held, w + 3.0 * worse * ripple, np.nan),
            "augmented": np.where(held, w, np.nan),
        },
        residual={"refitted": ripple + noise[1], "augmented": noise[2]},
        signals={"theta": theta, "w": w, "u": 0.3 * np.sign(w), "t": t},
    )


def effect(name="torque_ripple", **values):
    return Finding(name, {k: Estimate(v, "1", None) for k, v in values.items()})


def diagnosis(verdict="found", **changes):
    model = Model.of(table1())
    tr = traces()
    found = Finding(
        "torque_ripple",
        {
            "amplitude": Estimate(0.05012, "N m", (0.0489, 0.0513)),
            "harmonic": Estimate(N, "1/rev", (7.998, 8.002)),
            "phase": Estimate(PHI, "rad", None),
        },
        (Candidate("periodic_disturbance", 812.0, 0.2),),
    )
    ripple = {"amplitude": 0.05012, "harmonic": N, "phase": PHI}
    d = Diagnosis(
        verdict,
        (found,) if verdict in ("found", "ambiguous") else (),
        depends_on=("theta",) if verdict in ("found", "ambiguous", "unexplained") else (),
        experiment="record slow moves both ways" if verdict in ("ambiguous", "refused") else None,
        error={
            "signal": "w",
            "unit": "rad/s",
            "samples": 6000,
            "horizon": 1.0,
            "declared": None,
            "refitted": 0.21,
            "augmented": 0.021,
            "noise_floor": 0.0101,
        },
        free_error={
            "signal": "w",
            "unit": "rad/s",
            "in_sample": True,
            "declared": math.nan,
            "refitted": 0.4,
            "augmented": 0.1,
        },
        torque_error={"unit": "N m", "declared": 0.04, "refitted": 0.036, "augmented": 0.0022},
        model=model.with_effect("torque_ripple", ripple),
        declared=model.with_values({"J": 0.0024, "Fv": None}),
        estimates={"J": Estimate(0.0022, "kg m2", (0.002134, 0.002266))},
        record=Record(t=tr.t, u=tr.signals["u"], w=tr.measured, source=HOSTILE),
        messages=(f"{HOSTILE}: t has doubled stamps",),
        ranking=(
            Candidate("torque_ripple", 15321.0, 0.93),
            Candidate("gravity", 3.0, 0.04),
            Candidate("input_delay", -0.1, 0.0),
            Candidate("constant_torque", math.nan, 0.0),
        ),
        traces=tr,
        comparison=comparison(verdict),
    )
    if verdict == "refused":
        d = Diagnosis("refused", reason="u is constant.", experiment=d.experiment, record=d.record)
    return replace(d, **changes)


def comparison(verdict="found"):
    """A table of four models with its budget."""
    shares = (
        Share("coulomb", 0.26, 0.82, (0.81, 0.83), ("w",)),
        Share("viscous", 0.09, 0.3, (0.29, 0.31), ("w",)),
        Share("torque_ripple", 0.034, 0.11, (0.1, 0.12), ("theta",)),
        Share("left", 0.003, 0.009, None, ()),
        Share("noise", 0.002, 0.006, None, ()),
    )
    rows = (
        Compared("declared", 0.0, 0.0, 0.0, 9),
        Compared("torque_ripple", 15321.0, 210.0, 0.11, 11),
        Compared("unknown(theta)", 14000.0, 230.0, 0.1, 33),
        Compared("gravity", 3.0, 4.0, 0.01, 11),
    )
    return Comparison(verdict, rows=rows, budget=shares)


def bare(verdict="found"):
    """Without plots, which take most of the time."""
    return diagnosis(verdict, traces=None, ranking=(), comparison=None)


def answered(answer, record, model):
    """What a stand-in for ``diagnose`` returns: a refusal for Refused, other errors are raised."""
    if isinstance(answer, Refused):
        records = record if isinstance(record, list) else [record]
        return refusal(answer, model, [record_of(one) for one in records])
    if isinstance(answer, BaseException):
        raise answer
    return answer

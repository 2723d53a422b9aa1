"""Lines of blind results, written by hand."""

from __future__ import annotations

RIPPLE = {"amplitude": 0.04, "harmonic": 7.0, "phase": 3.1}


def effect(name, parameters=None, ties=()):
    values = {k: {"value": v, "ci95": ci} for k, (v, ci) in (parameters or {}).items()}
    return {"name": name, "parameters": values, "alternatives": [{"name": t} for t in ties]}


def line(names, verdict, *found, kind="effect", depends_on=(), told=(), **more):
    truth = {"effects": list(told) or [hidden(n) for n in names], "travel": 10.0,
             "motion": "rotary", "hard": ""}  # fmt: skip
    error = {"augmented": 0.11, "refitted": 0.5, "noise_floor": 0.1}
    answer = {"verdict": verdict, "effects": list(found), "depends_on": list(depends_on),
              "error": error, "reason": "short"}  # fmt: skip
    head = {"key": " ".join(names) or "none", "kind": kind, "names": list(names),
            "strength": "normal", "seed": 1, "at": "2030-02-03T00:00:00",
            "problems": []}  # fmt: skip
    return {**head, "truth": truth, "answer": answer, "cpu": 2.0, "wall": 3.0, **more}


def ripple(value, interval, harmonic=7.0):
    return line(
        ["torque_ripple"],
        "found",
        effect("torque_ripple", {"amplitude": (value, interval), "harmonic": (harmonic, None),
                                 "phase": (-3.1, [-3.3, -3.0])}),
        told=[hidden("torque_ripple", **RIPPLE)],
        floor=0.05,
    )  # fmt: skip


def hidden(name, **parameters):
    return {"name": name, "parameters": parameters, "depends_on": ["theta"], "visible": 0.1}

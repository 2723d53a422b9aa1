"""Results made up by hand."""

from __future__ import annotations

import numpy as np

from lugrectl.diagnosis.diagnose import Identification
from lugrectl.estimates.findings import Estimate, FrictionMap, Table

from .made_up import diagnosis


def identification():
    d = diagnosis()
    keys = ("estimates", "error", "model", "record", "messages", "declared", "traces")
    return Identification(**{k: getattr(d, k) for k in keys})


def table(values=(0.1, -0.1, 0.2)):
    values, points = np.array(values), np.array([0.0, 1.0, 2.0])
    error = 0.01 + 0 * values
    return Table(("theta",), points, values, error, False, 0.4, (0.3, 0.5), 0.1, "N m", 9)


def friction_map():
    w = np.array([-2.0, -1.0, 1.0, 2.0])
    curves = {"refitted": 0.3 * np.sign(w), "augmented": 0.31 * np.sign(w)}
    swing = ((2, Estimate(0.01, "N m", (0.008, 0.012))),)
    held_out = np.array([True, False, False, True])
    return FrictionMap(w, 0.3 * np.sign(w), 0 * w + 0.01, held_out, w, curves, "rotary", swing)

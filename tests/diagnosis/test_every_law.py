"""Each friction law of the package is identified from a log of a drive that has it."""

import numpy as np
import pytest

import lugrectl as lg

from ..cases.small_answers import STEP

DT, FINE = 2e-3, 20
SAMPLED = (pytest.mark.slow, pytest.mark.sample)
KNOWN = {
    "J": 0.002, "Fc": 0.12, "Fs": 0.16, "Fv": 0.02, "vs": 0.1, "sigma0": 60.0, "sigma1": 0.1,
}  # fmt: skip


def drive(law):
    model = lg.Model.of(J=KNOWN["J"], friction=law)
    return model.with_values({k: KNOWN.get(k, p.value) for k, p in model.declarations().items()})


def log(model):
    """16 s of a torque that is held, from rest."""
    t = DT * np.arange(8000)
    u = 0.5 * np.sin(np.pi * t) * (1.0 + 0.3 * np.sin(t)) + 0.12 * np.sin(4.6 * np.pi * t + 1.0)
    held, fine = np.repeat(u, FINE), DT / FINE * np.arange(FINE * len(u))
    made = lg.simulate(lg.plant(model), fine, np.array([held, 0.0 * held]))
    theta = made.outputs[list(made.output_labels).index("theta")][::FINE]
    return {"t": t, "u": u, "theta": STEP * np.round(theta / STEP)}


@pytest.mark.parametrize(
    "law",
    [
        law if law in ("coulomb", "stribeck", "lugre") else pytest.param(law, marks=SAMPLED)
        for law in lg.laws().names
    ],
)
def test_its_values_lie_in_their_intervals(law):
    model = drive(law)
    found, right = lg.identify(log(model), lg.Model.of(friction=law)), model.known()
    assert {"J", "Fv"} <= {row.name for row in found.parameters if row.low is not None}
    for row in found.parameters:
        if row.low is not None:
            margin = 0.01 * abs(right[row.name])
            assert row.low - margin <= right[row.name] <= row.high + margin, row
    if "sigma0" in right:
        assert found.model.known()["sigma0"] == pytest.approx(60.0, rel=0.05)
    assert found.error["refitted"] < 0.002

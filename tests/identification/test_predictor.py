"""The model along a log: where it starts, and what its levels are."""

import numpy as np
import pytest

from lugrectl import Record, table1
from lugrectl.blocks.model import model_from_dict
from lugrectl.identification.dataset.dataset import prepare
from lugrectl.identification.dataset.windows import Windows
from lugrectl.identification.likelihood.predictor import Predictor

P = table1()
FRICTION = {k: getattr(P, k) for k in ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")}
T = np.arange(0.0, 4.0, 1e-3)


def model_with(name, own, ratio=1.0):
    levels = {k: ratio * FRICTION[k] for k in ("Fc", "Fs")}
    declared = {"plant": {"J": P.J}, "friction": {"model": "lugre", **FRICTION, **levels}}
    model = model_from_dict(declared, "here")
    return model.with_effect(name, own) if name else model


def held(u):
    """A drive that does not move."""
    noise = 1e-6 * np.random.default_rng(0).normal(size=(2, len(T)))
    return prepare([Record(t=T, u=np.full(len(T), u), w=noise[0], theta=noise[1])])


@pytest.mark.parametrize(
    "name, own",
    [
        ("friction_step", {"ratio": 0.5, "time": 1.0}),
        ("dwell_stiction", {"ratio": 0.5, "time_constant": 0.1}),
    ],
)
def test_a_drive_that_more_stiction_holds_starts_held(name, own):
    u, start = 1.3 * FRICTION["Fs"], Windows(np.array([3000]), 0, 1)

    def torque(model):
        predictor = Predictor(model, held(u))
        x0 = predictor.initial([model.known()], start)[0, 0]
        return FRICTION["sigma0"] * x0[predictor.lanes.states.index("z")]

    assert torque(model_with(name, own)) == pytest.approx(u, rel=1e-3)
    assert torque(model_with(None, {})) == pytest.approx(FRICTION["Fs"])


def test_parameters_become_inputs():
    law = model_with("", {}).friction.block
    open_law = law.with_inputs(("Fc", "Fs"))
    assert open_law.inputs == (*law.inputs, "Fc", "Fs")
    assert open_law.parameters.keys() == law.parameters.keys() - {"Fc", "Fs"}
    rest = {k: v for k, v in FRICTION.items() if k not in ("Fc", "Fs")}
    signals = 0.3 * np.ones(len(law.inputs)), 1e-5 * np.ones(len(law.states))
    given = open_law(*signals[0], FRICTION["Fc"], FRICTION["Fs"], *signals[1], **rest)
    assert given == law(*signals[0], *signals[1], **FRICTION)

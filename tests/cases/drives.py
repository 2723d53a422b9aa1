"""Shared by the tests of blocks and effects: signals, strengths, models, pure plants, a log."""

from types import SimpleNamespace

import numpy as np

from lugrectl.blocks.block import members
from lugrectl.blocks.model import model_from_dict
from lugrectl.blocks.plant import assemble
from lugrectl.loops import friction_loops as _loops  # noqa: F401  fills the registry

from .wired import simulate

EFFECTS = members("effect")
LAWS = members("friction")
J = 0.002


def arguments(made, shape, seed=0):
    """Random signals and states; z-like states stay small, as the bristles do."""
    rng = np.random.default_rng(seed)
    time = [rng.uniform(0.0, 5.0, shape)] if made.timed else []
    size = {
        s: 1e-3 if s.startswith(("z", "presliding")) else 1.0 for s in made.inputs + made.states
    }
    return time + [size[s] * rng.normal(size=shape) for s in made.inputs + made.states]


def strong(made, seed=0):
    """Parameter values away from the defaults, inside their bounds."""
    rng = np.random.default_rng(seed)
    values = {}
    for key, p in made.parameters.items():
        middle = p.value if np.isfinite(p.value) else 0.3
        low, high = max(p.low, middle - 0.5 * abs(middle) - 0.1), middle * 1.5 + 0.1
        values[key] = rng.uniform(low, min(p.high, max(high, low)))
        if p.choices:
            values[key] = float(rng.choice(p.choices))
    if made.kind == "effect" and made.gain == "Fs":
        values["Fs"] = 0.6  # above any Fc
    return values


def own(made, values):
    """Those values that are not borrowed from the plant."""
    return {k: v for k, v in values.items() if k in made.own}


def law_for(made):
    """The friction law that an effect is meant for."""
    return {"stribeck": "coulomb", "presliding": "stribeck"}.get(made.name, "lugre")


def model_of(law, J=0.0022, **values):
    """A model with the law's default parameters and nothing else."""
    friction = {k: p.value for k, p in LAWS[law].parameters.items() if p.fitted} | values
    return model_from_dict({"plant": {"J": J}, "friction": {"model": law, **friction}}, law)


def plant_of(model, **options):
    """The plant's pure function with all values filled in: arguments t, inputs, states."""
    made = assemble(model, **options)
    values = {k: v for k, v in model.values().items() if k in made.parameters}

    def rates(*signals):
        return made(*signals, **values)

    return made, rates


def log(motion="rotary", length=20.0, dt=1e-3):
    """A smooth motion with rests, as the hints of effects see it."""
    t = np.arange(0.0, length, dt)
    w = 3.0 * np.clip(np.sin(2.0 * np.pi * 0.3 * t) * 1.5, -1.0, 1.0) ** 3
    w[np.abs(w) < 0.05] = 0.0
    a = np.gradient(w, dt)
    u = 0.0022 * a + 0.285 * np.sign(w) + 0.018 * w
    theta, load = np.cumsum(w) * dt, 0.1 * np.sin(t)
    return SimpleNamespace(t=t, theta=theta, w=w, a=a, u=u, load=load, dt=dt, motion=motion)


def free(J=J):
    """A drive without friction."""
    return model_of("viscous", J, Fv=0.0)


def run(system, t, u=0.0, x0=0.0):
    inputs = np.zeros((system.ninputs, len(t)))
    inputs[0] = u
    return simulate(system, t, inputs, x0, rtol=1e-10, atol=1e-13, max_step=1e-3)


def states(system, **values):
    x = np.zeros(system.nstates)
    for name, value in values.items():
        x[system.state_labels.index(name)] = value
    return x

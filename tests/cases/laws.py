"""Shared by the tests of friction laws: cases, models, and a law along a given speed."""

import numpy as np
from scipy.integrate import solve_ivp

import lugrectl as lg
from lugrectl.blocks.block import members

J, S0, S1, FC, FS, FV, VS = 0.0022, 260.0, 0.6, 0.285, 0.335, 0.018, 0.01
TABLE1 = {"sigma0": S0, "sigma1": S1, "Fc": FC, "Fs": FS, "Fv": FV, "vs": VS}
LAWS = members("friction")
FREE = {"stribeck": {"delta": 0.7}, "lugre": {"delta": 1.0}}
SHAPED = {"maxwell_slip": {"elements": 3}, "leuven": {"elements": 2, "n": 3.0}}
SHAPED |= {"dahl": {"n": 2.0}, "bouc_wen": {"n": 3.0, "beta": 0.8}}
CASES = {name: (name, {}) for name in LAWS}
CASES |= {f"{name}, {next(iter(v))}": (name, v) for name, v in {**FREE, **SHAPED}.items()}
CASES |= {"lugre, vd": ("lugre", {"vd": 0.05})}
DYNAMIC = [c for c, (name, _) in CASES.items() if LAWS[name].states]


def model_of(case):
    law, own = CASES[case]
    known = {k: v for k, v in TABLE1.items() if k in LAWS[law].parameters}
    return lg.Model.of(J=J, friction=law, **known, **own)


def values_of(case):
    model = model_of(case)
    return model.friction.block, {k: v for k, v in model.friction.values.items()}


def rate(case, w, x):
    made, values = values_of(case)
    return np.array(made(w, *x, **values)[1:])


def along(case, w, t):
    """Torque and states for a given speed w(t), by a tight stiff solver."""
    made, values = values_of(case)

    def rates(s, x):
        return np.array(made(w(s), *x, **values)[1:])

    turns = {"method": "LSODA", "rtol": 1e-9, "atol": 1e-13, "max_step": 1e-3, "t_eval": t}
    x = solve_ivp(rates, (t[0], t[-1]), np.zeros(len(made.states)), **turns).y
    return np.asarray(made(w(t), *x, **values)[0]), x

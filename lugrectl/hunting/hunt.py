"""``lugrectl.limit_cycles``: whether a position loop hunts."""

from __future__ import annotations

from typing import Any

from ..blocks.model import Model, as_model
from ..core.errors import InputError
from ..core.validation import number
from .curve import curve_of
from .lanes import Loop
from .result import LimitCycles
from .rigid import rigid_cycles

PAPER = {"kp": 15.0, "ki": 1.55, "kd": 0.0}
SLIDING = (
    "{} slides here by its sliding curve, without bristles: cycles smaller than their deflection "
    "({:.2g}) are not seen, larger ones are a little smaller and slower than with them"
)


def limit_cycles(
    model: Any,
    *,
    kp: float | None = None,
    ki: float | None = None,
    kd: float | None = None,
    kv: float | None = None,
) -> LimitCycles:
    """Friction limit cycles of a PID position loop, or their absence.

    J dw/dt = u - F(w), u = -(kp e + ki int e + kd w), e = theta - r with r constant. With ``kv``
    the cascade u = (kp + ki/s)(-kv e - w), which is the PID kp kv + ki, ki kv, kp.
    """
    known = as_model(model)
    gains = _gains(kp, ki, kd, kv)
    loop = Loop(curve_of(known), float(known.J or 0.0), **gains)
    answer = rigid_cycles(loop)
    return LimitCycles(
        tuple(answer.cycles),
        answer.basin,
        answer.proof,
        answer.diverges,
        {**gains, "J": loop.J, "law": known.friction.block.name, "model": known.name},
        (*answer.messages, *_left_out(known)),
        answer.curve,
        known.motion,
    )


def _gains(kp: Any, ki: Any, kd: Any, kv: Any) -> dict[str, float]:
    """kp, ki and kd of the PID: the paper's if none is given, else 0 for those left out."""
    given = {k: v for k, v in {"kp": kp, "ki": ki, "kd": kd}.items() if v is not None}
    if kv is not None and kd is not None:
        raise InputError("with kv the loop is a cascade, which has no kd: leave one of them out.")
    own = dict.fromkeys(PAPER, 0.0) | {k: number(v, k) for k, v in given.items()}
    gains = own if given or kv is not None else PAPER
    if kv is not None:
        outer, p, i = number(kv, "kv"), gains["kp"], gains["ki"]
        gains = {"kp": p * outer + i, "ki": i * outer, "kd": p}
    for k, v in gains.items():
        if v < 0.0 or (k == "kp" and v == 0.0):
            raise InputError(f"{k} = {v:g}: a position loop needs kp above 0, ki and kd from 0 on.")
    return gains


def _left_out(model: Model) -> list[str]:
    said = []
    if model.friction.block.states:
        stiff = model.friction.values.get("sigma0")
        at = f"{model.friction.values['Fs' if 'Fs' in model.friction.values else 'Fc'] / stiff:.2g}"
        said.append(SLIDING.format(model.friction.block.name, float(at)))
    if model.effects:
        said.append(f"left out of the loop: {', '.join(p.key for p in model.effects)}")
    return said

"""What a loop is built of: its observer, its controller and its limit, connected by names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..blocks import controllers
from ..blocks.block import Block, members
from ..blocks.declaration import meant, name_of
from ..blocks.model import Model, as_model
from ..blocks.observers import believed, observer, observer_block
from ..blocks.sliding_control import sliding_error
from ..core.errors import InputError
from ..core.validation import one_name, real, shown

if TYPE_CHECKING:
    import control as ct


OWN = "own"  # a gain that is left out: the observer's own default
OUTPUTS = ("theta", "w", "F", "Fhat", "u", "e")
DEFAULTS = {
    "velocity": {"kp": 1.6, "ki": 0.16},
    "position": {"kp": 15.0, "ki": 1.55, "kd": 0.0, "tau": None},
}
SEEN = ("theta", "w", "u", "e", "r", "s")
READ = ("theta", "w", "e", "r", "dr", "ddr", "s", "ar")
SLIDING = ("s", "ar")
ARGUMENTS = (  # of a loop
    *("observer", "kp", "ki", "kd", "tau", "K1", "K2", "k", "gains", "observer_parameters", "load"),
    *("prefilter", "feedforward", "limit", "tracking", "controller", "controller_gains", "name"),
)


def connected(
    parts: Sequence[Any], inputs: Sequence[str], outputs: Sequence[str], name: str
) -> ct.InterconnectedSystem:
    """Return the loop of these blocks."""
    import control as ct

    return ct.interconnect(
        list(parts),
        inputs=list(inputs),
        outputs=list(outputs),
        params={},  # empty: else two loops in one system would share the values of the last one
        check_unused=False,
        name=one_name(name),
    )


def models(p: Any, own: Any, observer: Any) -> tuple[Model, Model]:
    """Return the plant's model, and what the observer believes."""
    model = as_model(p, "p")
    return model, model if own is None else as_model(own, "observer_parameters")


def tracked(limit: Any, tracking: Any, kp: Any, ki: Any, loop: str) -> dict[str, Any]:
    """Return the time of the back-calculation, none without a limit."""
    if limit is None and tracking is not None:
        raise InputError(f"{loop}: tracking belongs to a limit: give limit in N m too.")
    if limit is None:
        return {}
    return {"tracking": controllers.tracking_time(kp, ki, tracking, loop)}


def loop_observer(
    name: str | None,
    p: Model,
    shared: Mapping[str, Any],
    gains: Mapping[str, Any] | None,
    sliding: bool = False,
) -> ct.NonlinearIOSystem:
    """The observer of a loop with its gains; ``sliding``: it is corrected by s in place of e."""
    name = name_of("observer", name)
    made = observer_block("no_observer" if name is None else name)
    _fits(made, SEEN)
    if "Fhat" not in made.outputs:
        raise InputError(f"{made.name} has no output Fhat; an observer in a loop needs one.")
    known = {}
    for gain, value in shared.items():
        absent = gain not in made.parameters
        if value is OWN or (absent and (value is None or real(value) == 0.0)):
            continue
        if absent:
            who = "without an observer there is" if name is None else f"the observer {name!r} has"
            raise InputError(f"{gain} = {shown(value)}: {who} no such gain; leave it out.")
        if value is None:
            own = f"{made.parameters[gain].value:g}"
            raise InputError(f"{gain} = None is no gain: leave it out for the default, {own}.")
        known[gain] = value
    inputs = [("s" if signal == "e" and sliding else signal) for signal in made.inputs]
    return believed(made, p, inputs=inputs, **(known | mapped(gains, "gains")))


def mapped(gains: Any, what: str) -> dict[str, Any]:
    if not (gains is None or isinstance(gains, Mapping)):
        raise InputError(f"{what} must be a dict of numbers by name, not {shown(gains)}.")
    return dict(gains or {})


def both(name: str | None, gains: Any, more: Mapping[str, Any]) -> dict[str, Any]:
    """Gains of an observer given as a dict and as arguments."""
    known, made = mapped(gains, "gains"), observer_block("no_observer" if name is None else name)
    for key in more:
        if key not in made.parameters:
            raise InputError(
                f"{key} is no argument of the loop and no parameter of {made.name}; "
                f"{meant(key, (*made.parameters, *ARGUMENTS))}"
            )
    if twice := sorted({*known} & {*more}):
        raise InputError(f"{twice[0]} is given twice: in gains and as an argument.")
    return known | dict(more)


def controller_block(name: Any) -> Block:
    """The registered controller of a name, one that puts out u from what a loop offers."""
    known = members("controller")
    name = name_of("controller", name)
    made = known.get(name) if isinstance(name, str) else None
    if made is None:
        able = [k for k, b in known.items() if not _misfit(b)]
        raise InputError(f"unknown controller {shown(name)}; {meant(name, able)}")
    _fits(made, READ)
    if why := _misfit(made):
        raise InputError(f"{made.name} is not the controller of a loop: {why}.")
    return made


def _misfit(made: Block) -> str:
    if "u" not in made.outputs:
        return "it has no output u"
    return "" if set(made.inputs) & {"e", *SLIDING} else "it reads no error"


def _fits(made: Block, offered: Sequence[str]) -> None:
    strange = [s for s in made.inputs if s not in offered]
    if strange:
        raise InputError(
            f"{made.name} needs {', '.join(strange)}; a ready-made loop offers "
            f"{', '.join(offered)}: wire it with control.interconnect."
        )


def error_s(
    kind: str, gains: Mapping[str, Any] | None, names: Mapping[str, str]
) -> ct.NonlinearIOSystem:
    lam = mapped(gains, "controller_gains").get("lam", 20.0)
    measured = ["theta", "w"] if kind == "position" else ["w"]
    wanted = [*measured, *("r", "dr", "ddr")[: 1 + len(measured)]]
    return sliding_error(lam, kind, inputs=[names.get(k, k) for k in wanted])


def derivatives(kind: str, signals: Sequence[str]) -> list[str]:
    """The derivatives of the reference from which these signals of a loop are computed."""
    needs = {"s": {"dr"}, "ar": {"dr", "ddr"}} if kind == "position" else {"ar": {"dr"}}
    wanted = set().union(*(needs.get(k, {k}) for k in signals))
    known = ("dr", "ddr") if kind == "position" else ("dr",)
    if kind == "velocity" and "ddr" in wanted:
        raise InputError(f"a velocity loop has no ddr, only {controllers.DERIVATIVE[kind]}.")
    return [k for k in known if k in wanted]


def placed(J: float, *poles: float) -> dict[str, float]:
    """Return the gains with the zeros of J s^2 + kp s + ki, or of the third degree, at -poles."""
    names = ("kp", "ki") if len(poles) == 2 else ("kd", "kp", "ki")
    gains = dict(zip(names, J * np.poly(-np.array(poles))[1:], strict=True))
    return {k: float(gains[k]) for k in ("kp", "ki", "kd") if k in gains}


def all_at(kind: str, J: float, rate: float) -> dict[str, float]:
    """Return the gains with every pole at -rate."""
    return placed(J, *[rate] * (2 if kind == "velocity" else 3))


def crossing(kind: str, J: float, bandwidth: float) -> dict[str, float]:
    """Return the gains of a PI that crosses over at the bandwidth in rad/s, its integral 20 times
    as slow, or of a critically damped PD with kd/J there."""
    if kind == "velocity":
        split = np.sqrt(1.0 - 4.0 / 20.0)  # of two poles with the sum b and the product b^2/20
        return placed(J, 0.5 * (1.0 + split) * bandwidth, 0.5 * (1.0 - split) * bandwidth)
    return placed(J, 0.5 * bandwidth, 0.5 * bandwidth, 0.0)


MEASURED = {"w": "w_m", "theta": "theta_m", "u": "u_fb"}
REFERENCE = ("r", "dr", "ddr")


@dataclass(frozen=True)
class Control:
    """A PI of the speed or a PID of the position by its gains ``feedback``, and an observer by its
    name and its ``gains``. ``ahead``: J times the acceleration of the reference is added."""

    kind: str
    feedback: Mapping[str, float]
    observer: str | None = None
    gains: Mapping[str, Any] = field(default_factory=dict)
    ahead: bool = True

    def blocks(self, p: Model) -> list[Any]:
        """Return the blocks from w_m, theta_m, r and its derivatives to u, by the model p."""
        made = observer_block("no_observer" if self.observer is None else self.observer)
        measured = MEASURED[controllers.MEASURED[self.kind]]
        seen = [MEASURED.get(s, s) for s in made.inputs]
        own: Any = {"outputs": ["u_fb"]}  # u without what else puts out u
        if self.kind == "velocity":
            feedback = [controllers.pi(**self.feedback, **own)]
        else:  # D on the velocity error: on w alone it would act against the reference motion
            feedback = [
                controllers.error(name="error_w", inputs=["dr", "w_m"], outputs=["e_w"]),
                controllers.pid(**self.feedback, inputs=["e", "e_w"], **own),
            ]
        return [
            controllers.error(self.kind, inputs=["r", measured]),
            *feedback,
            *[controllers.feedforward(p, self.kind, **own)] * self.ahead,
            observer(made.name, p, inputs=seen, **self.gains),
            controllers.compensation(1.0, **own),
            controllers.compensation(name="drive", inputs=["u_fb"]),
            *([error_s(self.kind, None, MEASURED)] if "s" in made.inputs else []),
        ]


def read_of(parts: list[Any]) -> list[str]:
    """Return the reference and those of its derivatives that the blocks read."""
    read = {signal for block in parts for signal in block.input_labels}
    return [signal for signal in REFERENCE if signal in read]

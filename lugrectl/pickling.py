"""Blocks, python-control systems and loops that pickle, or say in one sentence why not.

python-control's own systems hold functions that do not pickle. Where it makes such a function
from the system itself (a state space, an interconnection), the function is left out and made
again on loading; this holds for all systems of these classes once lugrectl.spec is imported.
"""

from __future__ import annotations

import copyreg
import importlib
import pickle
import sys
from types import FunctionType
from typing import Any

import control as ct
import numpy as np
from control.statesp import LinearICSystem

from .errors import InputError

BY_VALUE = ("cloudpickle", "dill")  # picklers that carry functions themselves, not their names


class NotPicklable(InputError, pickle.PicklingError):
    """A system holds something that cannot be pickled; the sentence names the block."""


def carried(what: str, value: Any, cure: str = "") -> None:
    """Raise NotPicklable where a part of a system cannot be pickled; ``cure``: what to do.

    Nothing is raised where functions are copied, or carried by value: cloudpickle can do that.
    """
    try:
        pickle.dumps(value)
    except NotPicklable:
        raise
    except Exception:
        if not _functions_are_carried():
            is_what, usual = _described(value)
            raise NotPicklable(
                f"{what} is {is_what}, which cannot be pickled: {cure or usual}."
            ) from None


def _described(value: Any) -> tuple[str, str]:
    """What it is, and what to do about it."""
    where = "at the top level of a module or of a notebook cell"
    name = str(getattr(value, "__qualname__", ""))
    if str(getattr(value, "__module__", "")).startswith("control."):
        return "a function that python-control made", "give the block a function of your own"
    if "<lambda>" in name:
        return "a lambda", f"write it with def {where}"
    if name:
        return f"the function {name.split('.')[-1]}", f"define it {where}, under this name"
    return f"an object of the class {type(value).__name__}", f"define what it holds {where}"


def _functions_are_carried() -> bool:
    frame: Any = sys._getframe(1)
    while frame is not None:
        home = str(frame.f_globals.get("__name__", "")).split(".")
        if home[0] == "copy" or any(name in home for name in BY_VALUE):
            return True
        frame = frame.f_back
    return False


def declared(kind: str, name: str, home: str) -> Any:
    """A registered block, its module imported where that is needed.

    Raises
    ------
    InputError
        When this session has no such block.
    """
    from .spec import REGISTRY

    if (kind, name) not in REGISTRY and home not in ("__main__", "__mp_main__", ""):
        try:
            importlib.import_module(home)
        except ImportError:
            pass
    if (kind, name) not in REGISTRY:
        where = "the notebook cell or script" if home == "__main__" else f"the module {home}"
        raise InputError(
            f"the {kind} '{name}' is not declared in this session: run {where} that declares it "
            "with @block, then load again."
        )
    return REGISTRY[kind, name]


def rebuilt(function: Any) -> Any:
    """The block of a function that knows how to build it."""
    return function.block()


def from_fields(cls: type, state: dict[str, Any]) -> Any:
    """A frozen object from its fields."""
    made: Any = object.__new__(cls)
    made.__dict__.update(state)
    return made


def own_functions(system: Any) -> bool:
    """Whether python-control, or the loading below, made both functions from the system itself."""
    return all(_is_of(f, system) for f in (system.updfcn, system.outfcn))


def _is_of(function: Any, system: Any) -> bool:
    if not isinstance(function, FunctionType) or function.__closure__ is None:
        return False
    home = function.__module__.startswith("control.") or function.__module__ == __name__
    return home and all(cell.cell_contents is system for cell in function.__closure__)


def _reduced(system: Any) -> Any:
    state = dict(vars(system))
    if isinstance(system, (ct.StateSpace, ct.InterconnectedSystem)) and own_functions(system):
        del state["updfcn"], state["outfcn"]
    elif _is_nothing(system.updfcn) and not system.nstates:
        state["updfcn"] = no_states
    for what, key in (("update", "updfcn"), ("output", "outfcn")):
        if key in state:
            carried(f"the {what} function of the block {system.name}", state[key])
    return restored, (type(system), state)


def _is_nothing(function: Any) -> bool:
    """python-control's stand-in for the update function of a system without states."""
    name = getattr(function, "__qualname__", "")
    return name == "NonlinearIOSystem.__init__.<locals>.<lambda>"


def no_states(t: Any, x: Any, u: Any, params: Any) -> np.ndarray:
    """dx/dt of a system without states."""
    return np.zeros(0)


def restored(cls: type, state: dict[str, Any]) -> Any:
    """A python-control system from its attributes."""
    system: Any = from_fields(cls, state)
    if "updfcn" in state:
        return system
    if isinstance(system, ct.StateSpace):
        system.updfcn, system.outfcn = _linear(system)
    else:
        system.updfcn, system.outfcn = _wired(system)
    return system


def _linear(system: Any) -> tuple[Any, Any]:
    def update(t: Any, x: Any, u: Any, params: Any) -> Any:
        return system.A @ np.atleast_1d(x) + system.B @ np.atleast_1d(u)

    def output(t: Any, x: Any, u: Any, params: Any) -> Any:
        return system.C @ np.atleast_1d(x) + system.D @ np.atleast_1d(u)

    return update, output


def _wired(system: Any) -> tuple[Any, Any]:
    def update(t: Any, x: Any, u: Any, params: Any) -> Any:
        system._update_params(params)
        return system._rhs(t, x, u)

    def output(t: Any, x: Any, u: Any, params: Any) -> Any:
        system._update_params(params)
        return system._out(t, x, u)

    return update, output


for _class in (ct.NonlinearIOSystem, ct.StateSpace, ct.InterconnectedSystem, LinearICSystem):
    copyreg.pickle(_class, _reduced)  # pyright: ignore[reportArgumentType]

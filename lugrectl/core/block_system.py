"""Systems of python-control that pickle, and blocks whose parameters carry the block's name.

A system holds functions that do not pickle. Where python-control builds such a function from the
system itself (a state space, an interconnection), it is left out and built again on loading.
"""

from __future__ import annotations

import copyreg
from types import FunctionType
from typing import Any

import control as ct
import numpy as np
from control.statesp import LinearICSystem

from .pickling import carried, from_fields


class BlockSystem(ct.NonlinearIOSystem):
    """A block of the package: a copy of it, or the block under a new name, has its own parameters.

    The keys of the parameters begin with the name: ``plant.Fc``, ``twin.Fc`` in a copy "twin".
    """

    @property
    def name(self) -> Any:
        return self.__dict__.get("name")

    @name.setter
    def name(self, value: Any) -> None:  # python-control sets it, also in its copies
        before = self.__dict__.get("name")
        self.__dict__["name"] = value
        renamed = getattr(self.__dict__.get("outfcn"), "renamed", None)
        if before in (None, value) or renamed is None:
            return
        self.updfcn, self.outfcn, keys = renamed(self.updfcn, value)
        for held in ("params", "_current_params"):
            values = self.__dict__.get(held, {})
            self.__dict__[held] = {keys.get(k, k): v for k, v in values.items()}


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
    """Rates and outputs of a state space."""

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


PICKLED = (BlockSystem, ct.NonlinearIOSystem, ct.StateSpace, ct.InterconnectedSystem)
for _class in (*PICKLED, LinearICSystem):
    copyreg.pickle(_class, _reduced)  # pyright: ignore[reportArgumentType]

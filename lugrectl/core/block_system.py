"""Systems of python-control that pickle, and blocks whose parameters carry the block's name.
Functions that python-control builds from a system itself are left out and built again on
loading."""

from __future__ import annotations

import copyreg
from types import FunctionType
from typing import Any

import control as ct
import numpy as np
from control.statesp import LinearICSystem

from .pickling import carried, from_fields


class BlockSystem(ct.NonlinearIOSystem):
    """A block of the package: a copy of it, or the block under a new name, has its own parameters,
    whose keys begin with the name: ``plant.Fc``, ``twin.Fc`` in a copy "twin"."""

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
    for function in (system.updfcn, system.outfcn):
        if not isinstance(function, FunctionType) or function.__closure__ is None:
            return False
        home = function.__module__.startswith("control.") or function.__module__ == __name__
        if not home or any(cell.cell_contents is not system for cell in function.__closure__):
            return False
    return True


def _reduced(system: Any) -> Any:
    state = dict(vars(system))
    # python-control's stand-in for the update function of a system without states
    none = "NonlinearIOSystem.__init__.<locals>.<lambda>"
    if isinstance(system, (ct.StateSpace, ct.InterconnectedSystem)) and own_functions(system):
        del state["updfcn"], state["outfcn"]
    elif getattr(system.updfcn, "__qualname__", "") == none and not system.nstates:
        state["updfcn"] = no_states
    for what, key in (("update", "updfcn"), ("output", "outfcn")):
        if key in state:
            carried(f"the {what} function of the block {system.name}", state[key])
    return restored, (type(system), state)


def no_states(t: Any, x: Any, u: Any, params: Any) -> np.ndarray:
    """dx/dt of a system without states."""
    return np.zeros(0)


def restored(cls: type, state: dict[str, Any]) -> Any:
    """A python-control system from its attributes."""
    system: Any = from_fields(cls, state)

    def update(t: Any, x: Any, u: Any, params: Any) -> Any:
        if isinstance(system, ct.StateSpace):
            return system.A @ np.atleast_1d(x) + system.B @ np.atleast_1d(u)
        system._update_params(params)
        return system._rhs(t, x, u)

    def output(t: Any, x: Any, u: Any, params: Any) -> Any:
        if isinstance(system, ct.StateSpace):
            return system.C @ np.atleast_1d(x) + system.D @ np.atleast_1d(u)
        system._update_params(params)
        return system._out(t, x, u)

    if "updfcn" not in state:
        system.updfcn, system.outfcn = update, output
    return system


PICKLED = (BlockSystem, ct.NonlinearIOSystem, ct.StateSpace, ct.InterconnectedSystem)
for _class in (*PICKLED, LinearICSystem):
    copyreg.pickle(_class, _reduced)

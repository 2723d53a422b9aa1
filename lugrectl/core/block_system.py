"""Blocks whose parameters carry the block's name, also in copies and under a new name."""

from __future__ import annotations

from typing import Any

import control as ct


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

"""Models sent to other processes."""

from __future__ import annotations

import pickle
from dataclasses import dataclass

from ..core.errors import InputError
from .block import is_ours, members
from .extending import found, place
from .model import Model


@dataclass(frozen=True)
class Sent:
    """A model for another process, with the names of the user's own effects to load there."""

    packed: bytes
    effects: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, model: Model) -> Sent:
        own = [(b.name, place(b.home)) for b in members("effect").values()]
        return cls(pickle.dumps(model), tuple(e for e in own if not is_ours(e[1])))

    def open(self) -> Model:
        """The model; raises InputError if one of the user's blocks is not known here."""
        for name, home in self.effects:
            if found("effect", name, home) is None:
                raise InputError(
                    f"the effect '{name}' is not known in the worker processes; define it in a "
                    "module that can be imported, or use jobs=1."
                )
        return pickle.loads(self.packed)

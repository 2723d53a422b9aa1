"""Models sent to other processes."""

from __future__ import annotations

import contextlib
import pickle
from dataclasses import dataclass

from ..core.errors import InputError
from .block import REGISTRY, members
from .extending import fetch, place
from .model import Model


@dataclass(frozen=True)
class Sent:
    """A model for another process, with the names of the user's own effects to load there."""

    packed: bytes
    effects: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, model: Model) -> Sent:
        own = [(b.name, place(b.home)) for b in members("effect").values()]
        return cls(pickle.dumps(model), tuple(e for e in own if not _ours(e[1])))

    def open(self) -> Model:
        """The model; raises InputError if one of the user's blocks is not known here."""
        for name, home in self.effects:
            _known("effect", name, home)
        return pickle.loads(self.packed)


def _ours(home: str) -> bool:
    return home.split(".")[0] == "lugrectl"


def _known(kind: str, name: str, home: str) -> None:
    """Import the module of a registered block if necessary; InputError if it stays unknown."""
    if (kind, name) not in REGISTRY:
        with contextlib.suppress(ImportError):
            fetch(home)
    if (kind, name) not in REGISTRY:
        raise InputError(
            f"the {kind} '{name}' is not known in the worker processes; define it in a module "
            "that can be imported, or use jobs=1."
        )

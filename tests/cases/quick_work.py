"""A folder with logs and a model to work in, and a stand-in for the diagnosis that is quick."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.core.provenance import stamped

from .made_up import answered, bare


@pytest.fixture
def files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Two records and a model, as the working directory."""
    for name, phase in (("one.csv", 0.0), ("two.csv", 0.7)):
        t = np.arange(2000) * 1e-3
        u = 0.1 * np.sin(6.0 * t + phase) + 0.02 * np.sin(41.0 * t)
        w = np.r_[0.0, np.cumsum(u)[:-1]] * 1e-3 / 0.0022
        head = "t [s],u [N m],w [rad/s]"
        np.savetxt(tmp_path / name, np.c_[t, u, w], "%.9g", ",", header=head, comments="")
    lg.write_model(lg.Model.of(lg.table1()), tmp_path / "model.toml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def job(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Stands for lugrectl.diagnose: notes how it is called and returns or raises ``answer``."""
    fake: Any = ModuleType("lugrectl.diagnosis.diagnose")
    fake.calls, fake.answer = [], bare()

    @stamped("lugrectl.diagnose")
    def work(record: Any, model: Any, **options: Any) -> Any:
        fake.calls.append((record, model, options))
        return answered(fake.answer, record, model)

    fake.diagnose = fake.identify = work
    for name in ("diagnose", "identify"):
        monkeypatch.setitem(sys.modules, f"lugrectl.diagnosis.{name}", fake)
    return fake


def typed(capsys: Any, line: str, command: str = "") -> tuple[int, str, str]:
    """Exit code of a line that is typed, what it prints, and what it says beside."""
    code = main(f"{command} {line}".split())
    return code, *capsys.readouterr()

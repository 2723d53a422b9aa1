"""Log files of a small simulated machine, whole or broken on purpose, for the tests of reading."""

import functools
import math
import os
from pathlib import Path

import numpy as np
import pytest

from lugrectl.core.errors import InputError
from lugrectl.record import read_record
from lugrectl.record.files import child_process, readers

DATA = Path(os.environ.get("LUGRECTL_DATA", Path(__file__).parents[3] / "shared" / "data"))
measured = pytest.mark.skipif(not DATA.is_dir(), reason=f"no measured data at {DATA}")


@pytest.fixture
def undamaged(monkeypatch):
    """Files are whole: their library needs no process of its own."""
    monkeypatch.setattr(readers, "_by_child", lambda how, path: getattr(child_process, how)(path))


def driven(u, dt, rate, steps=10):
    """w and theta of dw/dt = rate(u, w, theta) from rest, by explicit Euler; u held over dt."""
    w, theta = np.zeros(len(u)), np.zeros(len(u))
    speed = angle = 0.0
    for k, torque in enumerate(u):
        w[k], theta[k] = speed, angle
        for _ in range(steps):
            speed += dt / steps * rate(torque, speed, angle)
            angle += dt / steps * speed
    return w, theta


def rubbing(J, Fc, Fv, width, load=lambda theta: 0.0):
    """dw/dt of a mass with Coulomb friction, smooth within a speed, viscous friction and a load."""
    return lambda u, w, theta: (u - load(theta) - Fc * math.tanh(w / width) - Fv * w) / J


@functools.cache
def machine(n=3000, dt=1e-3):
    """A mass with Coulomb and viscous friction."""
    rng = np.random.default_rng(1)
    t = np.arange(n) * dt
    u = 0.6 * np.sin(2 * np.pi * 0.7 * t) + 0.3 * np.sin(2 * np.pi * 2.3 * t + 1.0)
    u += 0.1 * np.sin(2 * np.pi * 7.1 * t)
    w, theta = driven(u, dt, rubbing(2e-3, 0.2, 0.02, 0.05))
    w += 1e-3 * rng.standard_normal(n)
    return {"t": t, "u": u, "w": w, "theta": np.round(theta / 1e-5) * 1e-5}


def rows(columns, delimiter=",", form="{:.9g}"):
    return "".join(
        delimiter.join(form.format(v) for v in row) + "\n" for row in zip(*columns, strict=True)
    )


def write(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


def csv(tmp_path, head="t,u,w,theta", change=None, keep=None, name="run.csv"):
    """Write the machine's log; ``change`` maps lines of text to lines, ``keep`` selects rows."""
    log = machine()
    keep = slice(None) if keep is None else keep
    lines = [head, *rows([log[r][keep] for r in ("t", "u", "w", "theta")]).splitlines()]
    return write(tmp_path / name, "\n".join(change(lines) if change else lines) + "\n")


def cell(line, column, text):
    """Return a change that puts text into one cell of line ``line`` (from 1)."""

    def change(lines):
        cells = lines[line - 1].split(",")
        cells[column] = text
        lines[line - 1] = ",".join(cells)
        return lines

    return change


def refused(kind, path, *words, **options):
    with pytest.raises(kind) as caught:
        read_record(path, **options)
    sentence = str(caught.value)
    for word in words:
        assert word in sentence, sentence
    assert "\n" not in sentence and sentence.endswith(".")
    assert caught.value.exit_code == (2 if kind is InputError else 3)
    return sentence

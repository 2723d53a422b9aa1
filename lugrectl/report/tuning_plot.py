"""The plot of a tuned loop: Nyquist's curve with the circle it keeps out of, and a step."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .canvas import headed, on_pyplot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINE, MARK = "#2c5f8a", "#c0392b"
WIDE = 3.0  # of the plane that is drawn


def tuning(found: Any) -> Sequence[Axes]:
    """L(jw) about -1, and the answer to a step of the reference."""
    return on_pyplot(panels(found), columns=2)


def panels(found: Any) -> list[Callable[[Axes], None]]:
    return [lambda ax: _nyquist(found, ax), lambda ax: _step(found, ax)]


def _nyquist(found: Any, ax: Axes) -> None:
    L = np.asarray(found.loop.frdata)[0, 0]
    turn = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    Ms = found.margins.Ms
    circle = -1.0 + turn / Ms
    ax.plot(np.real(L), np.imag(L), color=LINE, lw=1.3, label="L")
    ax.plot(np.real(circle), np.imag(circle), color=MARK, lw=0.9, label=f"Ms {Ms:.2f}")
    ax.plot(np.real(turn), np.imag(turn), color="0.7", lw=0.7, ls=":")
    ax.plot([-1.0], [0.0], "+", color=MARK)
    ax.set(xlim=(-WIDE, WIDE / 3), ylim=(-WIDE / 1.5, WIDE / 1.5), xlabel="Re L", ylabel="Im L")
    ax.set_aspect("equal")
    gains = found.cascade or {k: getattr(found, k) for k in ("kp", "ki", "kd")}
    said = ", ".join(f"{k} {v:.4g}" for k, v in gains.items() if v)
    headed(ax, f"{found._title()}\n{said}")


def _step(found: Any, ax: Axes) -> None:
    t, y = found.step()
    what = "speed" if found.structure == "PI" else "position"
    ax.plot(t, y, color=LINE, lw=1.3)
    ax.axhline(1.0, color="0.7", lw=0.7)
    ax.set(xlabel="t [s]", ylabel=f"{what} / reference", xlim=(0.0, t[-1] / 2))
    ax.set_title(f"A step of the {what}, without friction")

"""The result of a comparison of observers: a row for each."""

from __future__ import annotations

import html as markup
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from ..core.display import Grid, grid_html, grid_text, number
from ..core.result import ComparedRows, library, plain

COLUMNS = {  # field: heading, factor to the unit of the heading
    "velocity": ("e_w [mrad/s]", 1e3),
    "parameters": ("worst e_w [mrad/s]", 1e3),
    "position": ("e_theta [mrad]", 1e3),
    "cycle": ("cycle [mrad]", 1e3),
    "noise": ("noise in u [mN m]", 1e3),
    "delay": ("delay borne [ms]", 1e3),
    "load": ("load e_w [mrad/s]", 1e3),
    "rate": ("rate borne [Hz]", 1.0),
    "rounding": ("rounded e_w [mrad/s]", 1e3),
    "cost": ("cost [us]", 1e6),
}


@dataclass(frozen=True)
class Compared:
    """One observer. A value is None where its scenario was not run, infinite where the loop
    diverges.

    ``velocity``, ``position``: RMS tracking error in rad/s and rad, friction believed wrong.
    ``parameters``: the largest such error in rad/s with one more parameter wrong; ``weakest``
    names that parameter and the factor.
    ``cycle``: peak-to-peak position in rad of the limit cycle at a set-point, friction
    overestimated. ``noise``: RMS of the torque in N m that an RMS noise of the encoder causes.
    ``delay``: largest dead time in s that the velocity loop bears. ``load``: RMS speed error in
    rad/s from a load step on. ``rate``: lowest sample rate in Hz that the loop bears; ``sampled``
    has the RMS speed error at each rate tried. ``rounding``: RMS speed error in rad/s with the
    rounding of an encoder in the loop. ``cost``: time of the
    simulation in s for each sample. ``feedback``: the gains of the controllers beside it.
    """

    name: str
    velocity: float | None
    parameters: float | None
    position: float | None
    cycle: float | None
    noise: float | None
    delay: float | None
    cost: float | None
    feedback: Mapping[str, float]
    weakest: str | None = None
    load: float | None = None
    rate: float | None = None
    rounding: float | None = None
    sampled: Mapping[str, float] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return plain(asdict(self))


class ObserverComparison(ComparedRows[Compared]):
    """The answer of :func:`lugrectl.compare_observers`: rows by place or by name.

    Parameters
    ----------
    rows : list of Compared
        One for each observer.
    terms : dict
        What was equal for all: levels of friction believed, gains, noise, rate.
    refused : dict
        By name why an observer was left out, in one sentence.

    Examples
    --------
    Two observers on an encoder of 20 bits, with the RMS speed error of one of them:

    >>> found = lg.compare_observers(
    ...     lg.table1(), ["natural", "disturbance"], scenarios="rounding",
    ...     resolution=2 * np.pi / 2**20,
    ... )
    >>> found.names
    ('natural', 'disturbance')
    >>> round(1e3 * found["natural"].rounding)  # mrad/s
    5
    """

    def __init__(
        self,
        rows: Iterable[Compared],
        terms: Mapping[str, Any],
        refused: Mapping[str, str] | None = None,
    ) -> None:
        self._rows = tuple(rows)
        self.terms = dict(terms)
        self.refused = dict(refused or {})

    def summary(self) -> dict[str, Any]:
        """Plain Python: the terms, a dictionary for each observer, and who was left out."""
        rows = [row.summary() for row in self]
        return {"terms": plain(self.terms), "observers": rows, "refused": dict(self.refused)}

    def to_frame(self) -> Any:
        """A DataFrame in SI units with the names as index; InputError without pandas."""
        pandas = library("pandas")
        rows = [{k: getattr(row, k) for k in ("name", *COLUMNS)} for row in self]
        return pandas.DataFrame(rows).set_index("name")

    def _title(self) -> str:
        return f"{len(self)} observers at equal terms"

    def _grid(self) -> Grid:
        run = [k for k in COLUMNS if any(getattr(row, k) is not None for row in self)]
        head = ("observer", *(COLUMNS[k][0] for k in run))
        rows = [(row.name, *(_cell(getattr(row, k), COLUMNS[k][1]) for k in run)) for row in self]
        return Grid(head, "l" + "r" * len(run), tuple(rows))

    def __repr__(self) -> str:
        return "\n".join([self._title(), *grid_text(self._grid()), *self._left_out()])

    __str__ = __repr__

    def _repr_html_(self) -> str:
        left = "".join(f"<p>{markup.escape(line)}</p>" for line in self._left_out())
        return grid_html(self._grid()) + left

    def _left_out(self) -> list[str]:
        """A line for each reason, with the observers that it is about."""
        reasons: dict[str, list[str]] = {}
        for name, why in self.refused.items():
            reasons.setdefault(why, []).append(name)
        return [f"{', '.join(names)} left out: {why}" for why, names in reasons.items()]


def _cell(value: float | None, factor: float) -> str:
    if value is not None and value == float("inf"):
        return "diverges"
    return number(None if value is None else factor * value, 3)

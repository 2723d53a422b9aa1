"""The result of a comparison of friction laws: a row for each."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ..blocks.block import unit_for
from ..blocks.model import Model
from ..core.display import Grid, grid_html, grid_text, number
from ..core.result import ComparedRows, library, plain

CHOSEN = "The friction law {0} was chosen: {1}"
ALONE = "it predicts held-out samples best."
AMONG = "it has the fewest parameters of those that this record cannot distinguish (beside it {0})."


@dataclass(frozen=True)
class ComparedLaw:
    """One friction law, fitted to the training samples.

    ``elpd`` is the natural logarithm of how much more probable it makes the held-out samples than
    the chosen law does, ``se`` the standard error of that. ``torque`` is the RMS of the held-out
    residual torque in ``unit``, ``error`` that of the simulated motion. ``parameters`` counts the
    free ones. All are None, and ``reason`` says why, where the law could not be fitted.
    """

    name: str
    elpd: float | None = None
    se: float | None = None
    torque: float | None = None
    error: float | None = None
    parameters: int | None = None
    reason: str | None = None

    def summary(self) -> dict[str, Any]:
        """Plain Python."""
        return plain(asdict(self))


class LawComparison(ComparedRows[ComparedLaw]):
    """The answer of :func:`compare_laws`: rows by place or by name, the best first.

    Parameters
    ----------
    rows : list of ComparedLaw
        One for each law.
    chosen : str
        The simplest law that no other predicts better than.
    alike : list of str
        The laws that this record cannot distinguish from it.
    model : Model
        The declared model with that law and the values that both have.

    Attributes
    ----------
    unit : str
        That of ``torque``.

    Examples
    --------
    What a comparison of two laws looks like:

    >>> rows = [
    ...     lg.results.ComparedLaw("stribeck", elpd=0.0, se=0.0, torque=0.002, parameters=5),
    ...     lg.results.ComparedLaw("viscous", elpd=-800.0, se=25.0, torque=0.2, parameters=2),
    ... ]
    >>> laws = lg.results.LawComparison(rows, "stribeck", [], lg.Model.of(friction="stribeck"))
    >>> laws["viscous"].torque, laws.unit
    (0.2, 'N m')
    >>> laws.sentence
    'The friction law stribeck was chosen: it predicts held-out samples best.'
    """

    def __init__(
        self, rows: Iterable[ComparedLaw], chosen: str, alike: Sequence[str], model: Model
    ) -> None:
        self._rows = tuple(rows)
        self.chosen, self.alike, self.model = chosen, tuple(alike), model
        self.unit = unit_for("N m", model.motion)

    @property
    def sentence(self) -> str:
        """Which law was chosen, and why."""
        others = ", ".join(self.alike)
        return CHOSEN.format(self.chosen, AMONG.format(others) if others else ALONE)

    def summary(self) -> dict[str, Any]:
        """Plain Python: the chosen law, those as good, a dictionary for each law."""
        return {
            "chosen": self.chosen,
            "alike": list(self.alike),
            "unit": self.unit,
            "laws": [row.summary() for row in self],
        }

    def to_frame(self) -> Any:
        """A DataFrame with the names as index; InputError without pandas."""
        pandas = library("pandas")
        return pandas.DataFrame([row.summary() for row in self]).set_index("name")

    def grid(self) -> Grid:
        """The table as it is shown."""
        head = ("law", "predicts better by", "+-", f"torque [{self.unit}]", "parameters")
        return Grid(head, "lrrrr", tuple(map(self._cells, self)))

    def _cells(self, row: ComparedLaw) -> tuple[str, ...]:
        if row.elpd is None:
            return (row.name, "not fitted", "", "", "")
        gain = "0" if row.name == self.chosen else f"{row.elpd:,.1f}"
        se = "" if row.name == self.chosen else f"{row.se:,.1f}"
        return (row.name, gain, se, number(row.torque, 3), str(row.parameters))

    def __repr__(self) -> str:
        return "\n".join([self.sentence, *grid_text(self.grid())])

    __str__ = __repr__

    def _repr_html_(self) -> str:
        return f"<p>{self.sentence}</p>{grid_html(self.grid())}"

"""The joint distribution of fitted parameters, and the tests of what a fit leaves."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.display import Row
from ..core.numeric import Z95, rms
from ..core.result import Result, library, picked
from ..core.validation import whole
from ..core.views import view

LAGS = 25
TINY = 1e-150  # its square is still above 0
BOUND = 2.576  # standard deviations of a 99 % bound


@dataclass(frozen=True, eq=False, repr=False)
class Joint(Result):
    """The joint normal distribution of the free parameters around their fitted values.

    Attributes
    ----------
    names : tuple of str
        The free parameters.
    values : ndarray (n,)
        Their fitted values, SI.
    matrix : ndarray (n, n)
        Their covariance. Fc and Fv, for example, are strongly correlated.
    positive : ndarray (n,) of bool
        Those that are drawn as log-normal, since they are above 0.
    """

    names: tuple[str, ...]
    values: np.ndarray
    matrix: np.ndarray
    positive: np.ndarray

    @property
    def correlation(self) -> np.ndarray:
        """The correlation of the parameters, (n, n)."""
        size = np.sqrt(np.maximum(np.diag(self.matrix), 1e-300))
        return self.matrix / np.outer(size, size)

    @property
    def _sizes(self) -> np.ndarray:
        """Standard deviations of the values, or of their logarithms where ``positive``."""
        size = np.sqrt(np.maximum(np.diag(self.matrix), 0.0))
        ratio = size / np.where(self.positive, self.values, 1.0)
        return np.where(self.positive, np.sqrt(np.log1p(ratio**2)), size)

    def _away(self, steps: np.ndarray) -> np.ndarray:
        """The values, moved by steps of these sizes."""
        return np.where(self.positive, self.values * np.exp(steps), self.values + steps)

    def interval(self) -> np.ndarray:
        """The 95 % interval of each parameter by itself, (n, 2)."""
        half = Z95 * self._sizes
        return np.column_stack([self._away(-half), self._away(half)])

    def sample(self, n: int, seed: Any = None) -> dict[str, np.ndarray]:
        """n random sets of parameters: name -> (n,).

        A log-normal one has its value as median, and the logarithm's variance is
        log(1 + variance/value^2), that of the log-normal distribution with these moments.
        """
        n = whole(n, "n, the number of samples,", least=1)
        size = self._sizes
        C = self.correlation * np.outer(size, size)
        w, V = np.linalg.eigh(0.5 * (C + C.T))
        draws = np.random.default_rng(seed).standard_normal((n, len(w)))
        steps = (draws * np.sqrt(np.maximum(w, 0.0))) @ V.T
        return dict(zip(self.names, self._away(steps).T, strict=True))

    def summary(self) -> dict[str, Any]:
        return picked(self, "names matrix")

    def to_frame(self) -> Any:
        """The covariance as a DataFrame; InputError where pandas is not installed."""
        names = list(self.names)
        return library("pandas").DataFrame(self.matrix, index=names, columns=names)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.matrix, dtype=dtype)

    def _title(self) -> str:
        return "Covariance of the fitted parameters"

    def _rows(self) -> Iterable[Row]:
        strong = np.abs(np.tril(self.correlation, -1))
        for at in np.argsort(strong, axis=None)[::-1][:3]:
            i, k = np.unravel_index(at, strong.shape)
            if strong[i, k] > 0:
                name = f"correlation of {self.names[k]} and {self.names[i]}"
                yield Row(name, float(self.correlation[i, k]))


@dataclass(frozen=True, eq=False, repr=False)
class Residuals(Result):
    """What one-step predictions leave, with its correlation in time and with the torque.

    Attributes
    ----------
    signal : str
        The signal of the prediction errors.
    lags : ndarray (k,)
        In samples.
    autocorrelation, cross : ndarray (k,)
        Of the residual, and of the residual with u that many samples earlier.
    bound : float
        99 % bound of both for a model that misses nothing.
    """

    signal: str
    lags: np.ndarray
    autocorrelation: np.ndarray
    cross: np.ndarray
    bound: float

    @property
    def white(self) -> bool:
        """Whether the residual does not predict itself: all but a few lags are in the bound."""
        return bool(np.mean(np.abs(self.autocorrelation[1:]) < self.bound) > 0.9)

    @property
    def independent(self) -> bool:
        """Whether the residual does not depend on the torque before."""
        return bool(np.mean(np.abs(self.cross) < self.bound) > 0.9)

    def summary(self) -> dict[str, Any]:
        return picked(self, "signal lags autocorrelation cross bound white independent")

    def to_frame(self) -> Any:
        """A DataFrame: a row for each lag; InputError where pandas is not installed."""
        columns = picked(self, "autocorrelation cross")
        return library("pandas").DataFrame(columns, index=self.lags)

    def plot(self, ax: Any = None) -> Any:
        """Draw both correlations with their bound, into ``ax`` or a new figure."""
        return view("diagnosis_plots.correlations")(self, ax)

    def _title(self) -> str:
        return f"Residuals of {self.signal}"

    def _rows(self) -> Iterable[Row]:
        yield Row("white", "yes" if self.white else "no")
        yield Row("independent of u", "yes" if self.independent else "no")


def residuals_of(signal: str, e: np.ndarray, u: np.ndarray) -> Residuals:
    """The tests of prediction errors e, (windows, length), beside the torque u of their shape."""
    lags = np.arange(min(LAGS, e.shape[1] - 1) + 1)
    du = np.diff(u, axis=1, prepend=u[:, :1])  # a held torque repeats itself
    e, du = (x / max(rms(x), TINY) for x in (e - e.mean(), du))
    own, with_u = (
        np.array([np.mean(e[:, k:] * x[:, : e.shape[1] - k]) for k in lags]) for x in (e, du)
    )
    return Residuals(signal, lags, own, with_u, BOUND / float(np.sqrt(e.size)))

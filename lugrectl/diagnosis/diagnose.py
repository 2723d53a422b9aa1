"""From a log and a declared model to the named missing effect."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..core.deadline import within
from ..core.errors import Refused
from ..core.progress import Wanted, reporter, shows_progress
from ..core.provenance import stamped
from ..core.validation import positive, share
from ..parallel.blas_threads import one_blas_thread
from ..torque_balance.constants import ALPHA, FLOOR
from .asked import Asked, judged_by
from .balanced import diagnosed
from .compare_laws import under_law
from .refusal import refusal
from .result import Diagnosis

LIMIT = 270.0  # s that the answer may take


@shows_progress
@one_blas_thread()
@stamped("lugrectl.diagnose")
def diagnose(
    record: Any,
    model: Any,
    *,
    holdout: Any = None,
    horizon: float = 1.0,
    seed: int = 0,
    least: float = FLOOR,
    alpha: float = ALPHA,
    time_limit: float = LIMIT,
    law: str | None = None,
    columns: Mapping[str, str] | str | None = None,
    units: Mapping[str, str] | str | None = None,
    scale: Mapping[str, float] | str | None = None,
    rate: float | None = None,
    progress: Wanted = None,
) -> Diagnosis:
    """Find the physical effect that is missing from a declared model, from a log.

    Whatever may be missing is a row of one table: each effect of the catalogue, and an unknown
    torque over some signals, beside the declared model with free values. A row counts by how well
    it predicts parts of the log that its fit has not seen. What is named must hold in a last fit
    to all samples, which gives the values, and lower the torque error of held-out samples. On a
    clean log a fit by one-step predictions refines the values: where the torque that it does not
    predict is below ``least``. Errors are those of simulations from the recorded torque alone, on
    held-out samples; they decide nothing, and their fit has not used these samples.

    Parameters
    ----------
    record : path, DataFrame, dict of arrays or Record, or a list of them
        One run, or several; a folder stands for the runs in it. Runs may differ in their rates,
        and in the offset of the torque, which is fitted relative to the first run. Four or more
        runs at a steady speed each are one friction map: friction, and what depends on speed and
        angle, from their mean torques.
    model : Model, Parameters, dict or path
        The declared model; missing values are identified. Files are read with its motion.
    holdout : None, "last", or a record as above
        What is held out: every other block (None), the last half, or another run.
    horizon : float
        Time between restarts of the simulation, s.
    seed : int
        Seed of the random numbers, which only the error of the residual table uses.
    least : float
        The smallest torque that matters, as a share of RMS friction torque.
    alpha : float
        Chance that a gain in likelihood, of blocks that a fit has not seen, is called proven and
        is none.
    time_limit : float
        Seconds after which the fit stops itself; the comparison and the plain answer stand.
    law : str or None
        Friction law in place of the model's, a name of :func:`lugrectl.laws`; values that both have
        are kept. "auto": the one that :func:`lugrectl.compare_laws` chooses beside the effects.
    columns, units, scale, rate : optional
        How to read logs and holdout, as for :func:`lugrectl.read_record`.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Diagnosis
        With the verdict "refused" where the record cannot say what is missing; its ``plain`` then
        holds what is certain all the same.

    Raises
    ------
    InputError
        When an argument cannot be meant, or a file cannot be read or understood.

    Examples
    --------
    Ten runs at steady speeds of a made-up fan drive, of which the declared model contains only
    Coulomb and viscous friction:

    >>> noise = 0.002 * np.random.default_rng(0).standard_normal((10, 200))
    >>> speeds = [-3.0, -2.0, -1.0, -0.5, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0]
    >>> runs = [
    ...     {"t": 5e-3 * np.arange(200), "w": w + 0.5 * e,
    ...      "u": 0.3 * np.sign(w) + 0.02 * w + 0.004 * w * abs(w) + e}
    ...     for w, e in zip(speeds, noise)
    ... ]
    >>> model = lg.Model.of(J=0.0022, friction="coulomb", Fc=0.3, Fv=0.02)
    >>> found = lg.diagnose(runs, model)
    >>> found.verdict, found.effects[0].name
    ('found', 'quadratic_drag')
    >>> round(found.effects[0].parameters["coefficient"].value, 3)  # N m s2/rad2
    0.004

    A log of one motion, in a file beside a model file:

    >>> print(lg.diagnose("axis.csv", "axis.toml"))  # doctest: +SKIP
    """
    reading = {"columns": columns, "units": units, "scale": scale, "rate": rate}
    if law is not None:
        options = {"least": least, "alpha": alpha, "time_limit": time_limit, "progress": progress}
        options |= {"holdout": holdout, "horizon": horizon, "seed": seed, **reading}
        return under_law(diagnose, record, model, law, **options)
    limits = share(least, "least"), share(alpha, "alpha")
    limit, report = positive(time_limit, "time_limit", "seconds"), reporter(progress)
    asked = Asked.of(record, model, holdout, **reading)
    horizon, seed = judged_by(horizon, seed)
    try:
        with within(limit):
            return diagnosed(asked, horizon, seed, *limits, report)
    except Refused as no:
        return refusal(no, asked.model, asked.seen, asked.plain)

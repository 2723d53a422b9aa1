"""Which observer for this drive: all that it can run, simulated on it and put in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from ..blocks.model import Model, as_model, model_first
from ..blocks.observers import observer_block
from ..blocks.plant import plant
from ..core.errors import InputError
from ..core.progress import Wanted, part_of, reporter, shows_progress
from ..core.result import plain
from ..core.validation import flag, shown
from ..design import Certificate, design_gains
from ..design.observer_rules import RULES, SAMPLED
from ..estimates.fitted import Fitted
from .compare import chosen_observers
from .drive_spec import DriveSpec, drive_spec, units
from .loop import Terms
from .reasons import ALIKE, broken, reasons, unknown, unseen
from .recommendation import Candidate, Recommendation
from .trials import Stand, Trial, controller_gains, correction, course

NEAR = 1.5  # times the smallest error: beyond it an observer is not tried any further
FAR = 1e300  # below infinity: a loop that diverged is not tried any further
FASTER = 3.0  # times the controller's bandwidth: the rate of an observer that knows J alone
LITTLE = 0.9  # of the error without an observer: above it even the best one helps little
LAW = ("sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")


@shows_progress
def recommend_observer(
    p: Any,
    record: Any = None,
    *,
    observers: str | Sequence[str] | None = None,
    rate: float | None = None,
    noise: float | None = None,
    resolution: float | None = None,
    speed_noise: float | None = None,
    delay: float | None = None,
    measured: str | Sequence[str] | None = None,
    uncertainty: float | Mapping[str, float] | None = None,
    speed: float | None = None,
    frequency: float | None = None,
    bandwidth: float | None = None,
    load: float | None = None,
    gains: Mapping[str, Mapping[str, Any]] | None = None,
    certified: bool = False,
    progress: Wanted = None,
) -> Recommendation:
    """The friction observer for a drive: those that it can run, simulated and put in order.

    Parameters
    ----------
    p : Model, Parameters, dict, path, Diagnosis or Identification
        The drive with all values; of a diagnosis its model, and its record if none is given.
    record : Record, path, DataFrame, dict of arrays, or dict of numbers, optional
        A log of the drive, from which the rate, the noise and the step of the encoder, the speed
        and what is measured are estimated; or these values by the names below. Values that are
        given as arguments go first.
    observers : str or list of str, optional
        The observers to consider; default: all of ``lugrectl.observers()``.
    rate : float
        Sample rate of the drive in Hz.
    noise, resolution : float
        RMS noise of the position and step of the encoder in rad; default 0.
    speed_noise : float, optional
        RMS noise of the speed in rad/s, for a drive with a speed of its own. Without it the
        speed is the difference of two positions.
    delay : float
        Dead time between the torque command and the motor in s; default 0.
    measured : str
        "theta", "w" or "theta w", which observers may read; without w the loop is one of position.
    uncertainty : float or dict
        By what share the parameters may be wrong, each way; default 0.2. A dict gives it by name,
        ``{"Fc": 0.3, "J": 0.05}``.
    speed, frequency : float, optional
        Amplitude in rad/s and frequency in Hz of the reference, a sine; default: well outside
        presliding and above vs, or 0.8 of the record's speed; 1 Hz, at rates above 4 kHz rate/4000.
    bandwidth : float, optional
        Crossover of the controller in rad/s; default: what sampling and dead time allow, at
        most 500.
    load : float, optional
        Load torque in N m that steps in during the run "with a load step"; default: a fifth of
        the friction level.
    gains : dict, optional
        Gains by observer in place of those of :func:`design_gains`,
        ``{"extended_state": {"bandwidth": 200}}``.
    certified : bool
        Whether only observers whose gains have a certificate are admissible.
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    Recommendation
        ``.best``, ``.ranked`` with reasons, ``.refused`` with reasons. ``print`` shows all.

    Raises
    ------
    InputError
        For a model without a value, a missing rate, or an argument that cannot be used.

    Notes
    -----
    Every loop is that of :func:`compare_observers`, sampled: the encoder rounds, the observer and
    the controller run at the rate, the torque is held and acts after the dead time. All
    loops have the same linear feedback, and the feed-forward of the torque that accelerates J.
    The order is that of the largest RMS error over these cases: exact parameters, Fc and Fs wrong
    together, then J, sigma0, sigma1, Fv, vs wrong one at a time, each way. Observers that are
    more than 1.5 times worse than the best after the first three cases are not tried with the
    others. Of observers within 5 % of the best the one that passes least noise to the torque is
    first. The drive has the effects of the model; the observers do not know them.

    Examples
    --------
    Two observers for a drive at 1 kHz with an encoder of 20 bits:

    >>> advice = lg.recommend_observer(
    ...     lg.table1(), observers=["natural", "disturbance"],
    ...     rate=1000.0, resolution=2 * np.pi / 2**20,
    ... )
    >>> advice.best.name
    'disturbance'
    """
    model_first(p, record, "record")
    model, record = _model(p, record)
    spec = drive_spec(record, _own(locals()), model.motion).completed(_known(model))
    stand = _stand(model, spec, given_gains(gains))
    wanted = [name for name in chosen_observers(observers) if name != "no_observer"]
    if not wanted:
        raise InputError("observers holds no observer: give at least one of lugrectl.observers().")
    admissible, refused, certificates = _admissible(stand, wanted, certified)
    stand = replace(stand, terms=replace(stand.terms, designed=admissible))
    report = reporter(progress)
    report(0.0, "simulating the loop without an observer")
    none = stand.error("no_observer", {})
    trials = _trials(stand, list(admissible), report)
    unit = units(model.motion)["w" if stand.course.kind == "velocity" else "theta"]
    rows = []
    for name, trial in trials.items():
        why = broken(trial.errors, none, unit, spec.rate, np.isfinite(none))
        if why:
            refused[name] = why
        else:
            rows.append(_candidate(name, trial, stand, certificates[name]))
    return _answer(_ordered(rows), refused, none, stand)


def _own(given: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments that describe the drive."""
    names = DriveSpec.__dataclass_fields__
    return {k: v for k, v in given.items() if k in names}


def _model(p: Any, record: Any) -> tuple[Model, Any]:
    """The drive's model; that of a result with its record."""
    if isinstance(p, Fitted):
        made = getattr(p, "model", None)
        if not isinstance(made, Model):
            raise InputError("p: this result holds no model; give a model with all values.")
        record, p = (p.record if record is None else record), made
    model = as_model(p, "p").with_defaults()
    plant(model)  # a missing value is named
    return model, record


def _known(model: Model) -> dict[str, float]:
    own = ("J", *LAW)
    return {k: float(v) for k, v in model.values().items() if k in own and v is not None}


def given_gains(gains: Any) -> dict[str, dict[str, Any]]:
    """Gains by the full name of an observer, checked."""
    if gains is None:
        return {}
    if not isinstance(gains, Mapping) or not all(isinstance(v, Mapping) for v in gains.values()):
        raise InputError(f"gains must be a dict of dicts by observer, not {shown(gains)}.")
    made = {observer_block(name).name: dict(own) for name, own in gains.items()}
    for name, own in made.items():
        observer_block(name).check(own)
    return made


def _stand(model: Model, spec: DriveSpec, gains: Mapping[str, Mapping[str, Any]]) -> Stand:
    kind, known = "velocity" if "w" in spec.measured else "position", _known(model)
    assert spec.bandwidth is not None
    terms = Terms(model, correction(known, spec.bandwidth), True, gains, ahead=True)
    own = controller_gains(kind, known["J"], spec.bandwidth)
    return Stand(terms, spec, course(spec, kind), own)


def _admissible(
    stand: Stand, names: Sequence[str], certified: bool
) -> tuple[dict[str, dict[str, Any]], dict[str, str], dict[str, Certificate | None]]:
    """Gains of the observers that can be tried, reasons for those that cannot, certificates."""
    gains: dict[str, dict[str, Any]] = {}
    refused: dict[str, str] = {}
    made: dict[str, Certificate | None] = {}
    model, strict = stand.terms.model, flag(certified, "certified")
    for name in names:
        block, own = observer_block(name), stand.terms.designed.get(name)
        why = unseen(block.inputs, stand.spec.measured)
        why = why or unknown(block, _known(model), model.friction.block.name)
        if why is None:
            try:
                gains[name], made[name] = _designed(stand, name, own)
            except InputError as error:
                why = f"its gains cannot be designed for this drive: {error}"
        if why is None and strict and not made[name]:
            del gains[name]
            why = "its gains have no certificate, and certified=True asks for one."
        if why is not None:
            refused[name] = why
    return gains, refused, made


def _designed(
    stand: Stand, name: str, own: Mapping[str, Any] | None
) -> tuple[dict[str, Any], Certificate | None]:
    """Gains by the design rule, at the rate and the speed of the drive."""
    rule = RULES.get(name)
    if own is not None or (rule is None and name != "proposed_observer"):
        return dict(own or {}), None
    spec, choices = stand.spec, dict[str, Any]()
    assert spec.speed is not None
    fitting: dict[str, Any] = {"dt": 1.0 / spec.rate, "M": 1.5 * spec.speed, "speed": spec.speed}
    fitting |= {"w0": 0.2 * spec.speed, "k": stand.terms.k, "kp": stand.gains["kp"]}
    if name in ("disturbance_observer", "extended_state_observer"):  # noise grows with the rate
        assert spec.bandwidth is not None
        fitting["dt"] = max(fitting["dt"], SAMPLED / (FASTER * spec.bandwidth))
    if rule is not None:
        on_error = {"k", "kp"} if name in ("existing_observer", "lyapunov_observer") else set()
        wanted = {"dt", "M", "speed", "w0"} | on_error
        choices = {k: v for k, v in fitting.items() if k in wanted and k in rule.choices}
    design = design_gains(_Values(_known(stand.terms.model)), observer=name, **choices)
    return dict(design.gains), _about(name, stand.course.kind, design.certificate)


def _about(name: str, kind: str, made: Certificate) -> Certificate:
    """The certificate, which does not hold where it is about another loop."""
    if name == "normal_force_observer" and kind == "velocity":
        return replace(made, holds=False, valid="its proof is about a position loop")
    return made


class _Values:
    """Parameters as attributes."""

    def __init__(self, known: Mapping[str, float]) -> None:
        self.__dict__.update(known)


def _trials(stand: Stand, names: Sequence[str], report: Any) -> dict[str, Trial]:
    """All observers in the first cases, then the better ones in the others."""
    trials: dict[str, Trial] = {}
    for i, name in enumerate(names):
        part = part_of(report, 0.6 * i / len(names), 0.6 * (i + 1) / len(names))
        trials[name] = stand.first(name, part)
    best = np.inf
    for i, name in enumerate(sorted(trials, key=lambda k: trials[k].worst[1])):
        if not trials[name].worst[1] <= min(NEAR * best, FAR):
            break
        part = part_of(report, 0.6 + 0.4 * i / len(names), 0.6 + 0.4 * (i + 1) / len(names))
        stand.finish(name, trials[name], part)
        best = min(best, trials[name].worst[1])
    return trials


def _candidate(name: str, trial: Trial, stand: Stand, certificate: Certificate | None) -> Candidate:
    block, (case, worst) = observer_block(name), trial.worst
    return Candidate(
        name=name.removesuffix("_observer"),
        worst=worst,
        worst_case=case,
        errors=trial.errors,
        load=trial.load,
        noise=trial.noise,
        gains=stand.terms.own(name, stand.course.kind),
        certificate=certificate,
        reads=block.inputs,
        knows=tuple(k for k in ("J", *LAW) if k in block.parameters),
        complete=trial.complete,
    )


def _ordered(rows: Sequence[Candidate]) -> list[Candidate]:
    """By the largest error; those alike the best by noise."""
    found = sorted(rows, key=lambda row: row.worst)
    alike = [row for row in found if row.worst <= ALIKE * found[0].worst]
    return sorted(alike, key=lambda row: row.noise) + found[len(alike) :]


def _answer(
    rows: Sequence[Candidate], refused: Mapping[str, str], none: float, stand: Stand
) -> Recommendation:
    model, known = stand.terms.model, stand.terms.values()
    unit, signal = units(model.motion), "w" if stand.course.kind == "velocity" else "theta"
    said = {"e": unit[signal], "u": unit["u"]}
    level = float(max(known.get("Fc", 0.0), known.get("Fs", 0.0)))
    explained = [replace(row, reasons=reasons(row, rows, none, said, level)) for row in rows]
    return Recommendation(
        ranked=tuple(explained),
        refused={k.removesuffix("_observer"): v for k, v in refused.items()},
        none=none,
        signal=signal,
        unit=unit[signal],
        motion=model.motion,
        drive=plain(asdict(stand.spec)),
        controller=dict(stand.gains),
        messages=_messages(stand, none, rows),
    )


def _messages(stand: Stand, none: float, rows: Sequence[Candidate]) -> tuple[str, ...]:
    said = []
    if not np.isfinite(none):
        said.append("The loop diverges without an observer too: give a lower bandwidth.")
    if stand.terms.model.effects:
        names = ", ".join(use.key for use in stand.terms.model.effects)
        said.append(f"The drive has {names}; the observers do not know of it.")
    spec = stand.spec
    if not (spec.noise or spec.resolution or spec.speed_noise):
        said.append("The sensor is taken as exact: give noise or resolution.")
    if rows and rows[0].worst > LITTLE * none:
        said.append("Even the best observer may help little with parameters as wrong as these.")
    if not rows:
        said.append("No observer is admissible on this drive; the reasons are in refused.")
    return tuple(said)

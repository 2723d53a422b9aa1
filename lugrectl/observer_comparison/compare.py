"""Observers at equal terms: the same drive, wrong belief, linear feedback, encoder and rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..blocks.aliases import listed, meant
from ..blocks.block import members
from ..blocks.model import as_model, model_first
from ..blocks.observers import observer_block
from ..core.errors import InputError
from ..core.progress import Wanted, part_of, reporter, shows_progress
from ..core.validation import flag, names, number, positive, share, shown
from .comparison import ObserverComparison
from .loop import Terms
from .reasons import unknown
from .scenarios import FINE, GAINS, SCENARIOS, STEP, compared

if TYPE_CHECKING:
    from ..blocks.model import Model, Parameters

RATES = (2000.0, 1000.0, 500.0, 250.0)  # Hz


@shows_progress
def compare_observers(
    p: Parameters | Model,
    observers: str | Sequence[str | None] | None = None,
    *,
    scenarios: str | Sequence[str] = SCENARIOS,
    wrong: float = 0.8,
    over: float = 1.2,
    off: float = 0.2,
    k: float = 0.35,
    equal: bool = True,
    noise: float = 1e-5,
    resolution: float = 0.0,
    load: float | None = None,
    rates: float | Sequence[float] = RATES,
    progress: Wanted = None,
) -> ObserverComparison:
    """Friction observers side by side on one drive, at equal linear feedback.

    Parameters
    ----------
    p : Parameters, Model, dict or path
        The drive. With another friction law than LuGre, one of your own too, observers that must
        know values which it does not have are left out: ``refused`` of the result says why.
    observers : str or list of str, optional
        Names as in ``lugrectl.observers()``, with or without ``_observer``; default: all. None in
        a list is the loop without an observer.
    scenarios : str or list of str
        Any of "velocity" (r = 0.1 sin 2 pi t rad/s, PI 1.6, 0.16; RMS of w - r over 1 to 5 s),
        "parameters" (the largest such error if one of J, sigma0, sigma1, Fv, vs is believed
        wrong as well, and which), "position" (r = 0.1 sin 2 pi t rad, PD 15, 1.2 and J ddr; RMS
        of theta - r over 5 to 10 s), "cycle" (PID 15, 30, 0.3, step of 0.1 rad;
        peak-to-peak theta over 10 to 15 s), "noise" (torque caused by noise of the encoder, in
        the velocity scenario), "delay"
        (the largest dead time between torque command and motor, up to 10 ms, with which the
        error of the velocity scenario grows by no more than the reference within 1 s; None if
        the loop switches too fast to be simulated), "load" (the speed error over 2 to 5 s, where a
        load torque steps in at 2 s and out at 3.5 s), "rate" (the lowest of ``rates`` at which the
        error stays as small as "delay" demands, with controller and observer sampled and the
        torque held; ``sampled`` of a row has the error at each rate) and "rounding" (the speed
        error at 1 kHz over 0.5 to 1.5 s where the speed is the difference of an encoder's rounded
        positions, inside the loop).
    wrong, over : float
        Fc and Fs as the observer believes them, as a factor: in all scenarios, and in "cycle".
    off : float
        How far the other parameters are wrong in "parameters", each way: 0.2 is 20 %.
    k : float
        Gain of the observers that are corrected by the tracking error.
    equal : bool
        Raise the gains of the controller beside all other observers by sigma1 k and sigma0 k,
        because the correction k e is a PI controller as well: zhat depends linearly on it.
    noise : float
        RMS noise of the encoder in rad at 1 kHz; the velocity is its difference.
    resolution : float
        Step of the encoder in rad, in "noise": its readings of the undisturbed motion, with
        noise, are rounded to it. 0 rounds nothing; 2 pi/4096 is 4096 steps a turn. Also the step
        in "rounding", where 0 stands for an encoder of 17 bits, 2 pi/131072.
    load : float, optional
        Load torque in N m in "load"; default: half of Fc, where the friction law has it.
    rates : float or list of float
        Sample rates in Hz in "rate".
    progress : callable, True, False or None
        ``progress(fraction, what)``, or whether to show a bar. None: in Jupyter only.

    Returns
    -------
    ObserverComparison
        A row for each observer; ``print`` shows a table, ``to_frame`` gives a DataFrame.

    Raises
    ------
    InputError
        For an unknown observer or scenario, a value that the drive does not have yet, no observer
        that this drive allows, or a number out of bounds.

    Notes
    -----
    The equivalent controller of the correction is k (sigma1 s + sigma0)/(s + a), a =
    sigma0 |w|/h(w): it leaks, where the controller of the others has a full integral. An observer
    on s = (w - dr) + 20 (theta - r) takes k/20 in the position loop, so that its integral action
    is the same; its action on theta and w is larger by sigma0 k/20 and sigma1 k/20. Velocity and
    position are exact except in "noise". The cost is the time of the simulation, not that of a
    drive's processor.

    The first comparison on a machine compiles two loops for each observer, some seconds for each;
    a later one takes about a second for each observer.

    Examples
    --------
    Which observer bears the rounding of an encoder of 20 bits, by the RMS speed error in rad/s:

    >>> found = lg.compare_observers(
    ...     lg.table1(), ["natural", "disturbance"], scenarios="rounding",
    ...     resolution=2 * np.pi / 2**20,
    ... )
    >>> all(row.rounding < 0.01 for row in found)
    True
    """
    model_first(p, observers, "observers")
    model = _complete(as_model(p, "p").with_defaults())
    wanted, chosen = _chosen_scenarios(scenarios), chosen_observers(observers)
    chosen, refused = _able(chosen, model)
    levels = {"wrong": positive(wrong, "wrong", "as a factor of friction")}
    levels["over"] = positive(over, "over", "as a factor of friction")
    terms = Terms(model, positive(k, "k", "1/s"), flag(equal, "equal"))
    levels["off"] = share(off, "off")
    levels["load"] = _load(load, model) if "load" in wanted else 0.0
    encoder, given = (positive(noise, "noise", "rad"), _step(resolution)), _rates(rates)
    report, rows = reporter(progress), []
    for i, name in enumerate(chosen):
        part = part_of(report, i / len(chosen), (i + 1) / len(chosen))
        rows.append(compared(terms, name, wanted, levels, encoder, given, part))
    said = {**levels, "k": terms.k, "equal": terms.equal, "step": STEP}
    said |= dict(zip(("noise", "resolution"), encoder, strict=True))
    said |= {"rates": given, "rounding": encoder[1] or FINE}
    return ObserverComparison(rows, said | {"gains": GAINS, "model": model.name}, refused)


def _complete(model: Model) -> Model:
    """The model, if it has all its values."""
    missing = [k for k, v in model.values().items() if v is None]
    if missing:
        raise InputError(
            f"p: a comparison of observers needs {', '.join(missing)} of the drive; give a model "
            "with all its values."
        )
    return model


def _able(names: Sequence[str], model: Model) -> tuple[list[str], dict[str, str]]:
    """The observers that can be given their parameters, and why the others cannot."""
    known, law = model.known(), model.friction.block.name
    why = {name: unknown(observer_block(name), known, law) for name in names}
    able = [name for name in names if why[name] is None]
    if not able:
        raise InputError(f"{names[0]} cannot be compared: {why[names[0]]}")
    return able, {k.removesuffix("_observer"): v for k, v in why.items() if v is not None}


def _load(given: float | None, model: Model) -> float:
    """The load torque in N m."""
    if given is not None:
        return number(given, "load")
    level = model.known().get("Fc")
    if level is None:
        law = model.friction.block.name
        raise InputError(
            f"load is missing: half of Fc is its default, which {law} friction does not have; give "
            "it in N m."
        )
    return 0.5 * level


def chosen_observers(wanted: Any) -> list[str]:
    """The full names of the observers that are meant, each once; None in a list for no observer."""
    if wanted is None:
        return [k for k in members("observer") if k != "no_observer"]
    given = listed("observer", wanted)
    if not isinstance(given, (list, tuple)) or not given:
        raise InputError(f"observers must be a name or a list of names, not {shown(wanted)}.")
    made = [observer_block("no_observer" if name is None else name).name for name in given]
    return list(dict.fromkeys(made))


def _chosen_scenarios(wanted: Any) -> set[str]:
    given = names(wanted, "scenarios")
    strange = [s for s in given if s not in SCENARIOS]
    if strange:
        hint = meant(strange[0], SCENARIOS)
        raise InputError(f"there is no scenario {shown(strange[0])}; {hint}")
    if not given:
        raise InputError(f"scenarios is an empty list: give some of {', '.join(SCENARIOS)}.")
    return set(given)


def _rates(wanted: Any) -> list[float]:
    given = wanted if isinstance(wanted, (list, tuple)) else [wanted]
    if not given:
        raise InputError("rates is an empty list: give at least one sample rate in Hz.")
    return [positive(rate, "rates", "Hz") for rate in given]


def _step(resolution: float) -> float:
    if number(resolution, "resolution") < 0.0:
        raise InputError(f"resolution is {resolution:g}; give the step in rad, or 0 for none.")
    return float(resolution)

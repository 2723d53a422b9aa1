"""Draws of whole logs: plain ones, real ones, and ones with a clear hidden effect."""

import numpy as np

from .effects import CLEAR, OUTSIDE, SMALL
from .logger import write
from .loop import SENSOR
from .machines import Rig, between, draw_control, draw_delay, draw_machine, draw_sensor
from .motion_facts import facts, leftover, nominal, simulate, sound
from .motions import draw_motion

# the channel without which an effect would not be in the log
NEEDS = {
    "velocity sensor lag": "w",
    "encoder eccentricity": "theta",
    "input delay": "command",
    "actuator lag": "command",
    "saturation": "command",
    "dead zone": "command",
}


def base(rng, kind: str):
    """A rig with a sound plain motion: rig, references, noise seed, columns, level."""
    while True:
        rig = draw_machine(rng, kind)
        draw_sensor(rng, rig)
        draw_delay(rng, rig)
        draw_control(rng, rig)
        motion, refs = draw_motion(rng, rig)
        seed = int(rng.integers(2**31))
        o = simulate(rig, refs, seed)
        rest, level, moving = leftover(rig, o, nominal(rig))
        if sound(rig, o, moving):
            return rig, motion, refs, seed, o, level


def with_values(rig: Rig, *sets: dict) -> Rig:
    """The rig with hidden values put where they belong."""
    values, sensor = dict(rig.values), dict(rig.sensor)
    for given in sets:
        for name, x in given.items():
            (sensor if name in SENSOR else values)[name] = x
    return Rig(**{**rig.__dict__, "values": values, "sensor": sensor})


def small_things(rng, rig: Rig, c: dict, taken: set) -> dict:
    """Two to four small unmodelled things, which leave a clear effect's values alone."""
    out = {}
    for name in rng.permutation(list(SMALL))[: int(rng.integers(2, 5))]:
        at = SMALL[name](rng, rig, c)
        given = at(between(rng, 0.002, 0.015)) if at else {}
        if given and not taken & set(given):
            out[str(name)] = given
            taken |= set(given)
    return out


def share(rig: Rig, o: dict, nom: dict) -> float:
    """The rms torque left over by the plain description, of the friction level."""
    rest, level, _ = leftover(rig, o, nom)
    return float(np.sqrt(np.mean(rest**2)) / level) if rest.size else np.inf


def truth_of(rig: Rig, motion: str, nom: dict, level: float, about: dict, hidden: dict) -> dict:
    """All that the log does not say."""
    out = {name: nom[name] for name in ("J", "Fc", "Fv")}
    out |= {"const": nom["const"], "gravity": (nom["grav"], nom["grav_ph"])}
    out |= {"Fs": max(nom["Fs"], nom["Fc"]), "vs": nom["vs"], "s0": nom["s0"], "s1": nom["s1"]}
    out |= {f"{name}_late": about[name]["late"] for name in ("u", "theta", "w") if name in about}
    out |= {"u_offset": about["u"]["offset"], "delay": nom["delay"], "level": level}
    out |= {"machine": rig.name, "friction": rig.model, "motion": motion, "fs": rig.fs}
    return out | {"channels": about, "control": dict(rig.control), "hidden": hidden}


def draw(seed: int, kind: str = "plain"):
    """A log and the truth about it.

    The motion obeys J dw/dt = u - Fc sgn(w) - Fv w - const - g sin(theta + phase), with
    (g, phase) the truth's gravity, until it stops; Fs and vs shape a Stribeck peak, s0 and
    s1 the bristles. A channel x of the log shows x at t - x_late (plus offset and noise);
    a negative one is ahead. Of kind "real", `hidden` names small things beside that.
    """
    return _draw(seed, kind)[:2]


def _draw(seed: int, kind: str):
    """The same, with the rig and its true motion."""
    if kind not in ("plain", "real"):
        raise ValueError(f'kind is "plain" or "real", not {kind!r}')
    rng = np.random.default_rng([seed, 71, kind == "real"])
    while True:
        rig, motion, refs, noise, o, level = base(rng, kind)
        nom, hidden = nominal(rig), {}
        if kind == "real":
            hidden = small_things(rng, rig, facts(rig, o, level), set())
            rig = with_values(rig, *hidden.values())
            o = simulate(rig, refs, noise)
        left = share(rig, o, nom)
        if left < 0.03:
            break
    log, about = write(rng, rig, o, level, kind)
    truth = truth_of(rig, motion, nom, level, about, hidden)
    truth["left_over"] = left
    return log, truth, rig, o, (refs, noise)


def draw_effect(seed: int, name: str | None = None):
    """A log of a real rig with one clear hidden effect, and the truth about it.

    As `draw`; besides, the truth's "effect" has a name, its values, whether it is `listed`
    among the usual ones and its share: rms torque by the friction level.
    """
    return _draw_effect(seed, name)[:2]


def _draw_effect(seed: int, name: str | None):
    """The same, with the rig and its true motion."""
    rng = np.random.default_rng([seed, 72, 2])
    every = {**CLEAR, **OUTSIDE}
    if name is None:
        name = str(rng.choice(list(OUTSIDE if rng.random() < 0.2 else CLEAR)))
    while True:
        rig, motion, refs, noise, o, level = base(rng, "real")
        nom, c = nominal(rig), facts(rig, o, level)
        at = every[name](rng, rig, c)
        if at is None:
            continue
        small = small_things(rng, rig, c, set(at(0.1)) | {"rand_f"})
        quiet = with_values(rig, *small.values())
        before = share(quiet, simulate(quiet, refs, noise), nom)
        if not before < 0.03:
            continue
        wanted = between(rng, 0.03, 0.4)
        found = strong_enough(rig, refs, noise, nom, at, small, wanted, before)
        if found is not None:
            break
    rig, o, given, size = found
    log, about = write(rng, rig, o, level, "real", need=NEEDS.get(name, ""))
    truth = truth_of(rig, motion, nom, level, about, small)
    truth["left_over"] = share(rig, o, nom)
    truth["effect"] = {"name": name, "values": given, "share": size, "listed": name in CLEAR}
    return log, truth, rig, o, (refs, noise)


def strong_enough(rig, refs, noise, nom, at, small, wanted, before):
    """The rig with an effect of about the wanted share, or None."""
    s = wanted
    for _ in range(4):
        given = at(s)
        new = with_values(rig, *small.values(), given)
        o = simulate(new, refs, noise)
        rest, _, moving = leftover(new, o, nom)
        if not sound(new, o, moving):
            s *= 0.4
            continue
        size = float(np.sqrt(max(share(new, o, nom) ** 2 - before**2, 1e-10)))
        if wanted / 1.4 < size < wanted * 1.4 and 0.03 < size < 0.45:
            return new, o, given, size
        s *= float(np.clip(wanted / size, 0.15, 6))
    return None

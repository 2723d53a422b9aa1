"""What is known of a drive beside its model: rate, sensor, dead time, motion, uncertainty."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blocks.aliases import meant
from ..core.errors import InputError
from ..core.validation import number, positive, real, share, shown
from ..record import Record
from ..record.as_record import as_record, is_record
from ..simulation.encoder import Sensing
from ..simulation.recorded_sensing import sensing_of
from .gains import fastest
from .reference import top_speed

UNCERTAIN = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
PERIOD = 4000  # samples in a period of the reference, at most
QUICK = 500.0  # rad/s, the highest crossover


@dataclass(frozen=True)
class DriveSpec:
    """A drive's sensor and task in SI units.

    ``measured``: theta, w or both. ``speed_noise`` None: the speed is the difference of two
    positions. ``source``: where the values come from.
    """

    rate: float
    noise: float
    resolution: float
    speed_noise: float | None
    delay: float
    measured: tuple[str, ...]
    speed: float
    frequency: float
    bandwidth: float
    load: float
    uncertainty: Mapping[str, float]
    source: str

    @property
    def sensing(self) -> Sensing:
        """The same for the simulation."""
        return Sensing(1.0 / self.rate, self.noise, self.resolution, self.speed_noise, self.delay)


KEYS = tuple(k for k in DriveSpec.__dataclass_fields__ if k != "source")


def completed(said: Mapping[str, Any], known: Mapping[str, float]) -> DriveSpec:
    """Return all values, those that are not said by the drive's parameters ``known``."""
    usual = {"noise": 0.0, "resolution": 0.0, "speed_noise": None, "delay": 0.0}
    usual |= {"measured": ("theta", "w"), "source": "the arguments"}
    spec = usual | dict(said)
    sensing = Sensing(1.0 / spec["rate"], speed_noise=spec["speed_noise"], delay=spec["delay"])
    level = max(known.get("Fc", 0.0), known.get("Fs", 0.0))
    f = spec.setdefault("frequency", max(1.0, spec["rate"] / PERIOD))
    presliding = level / known["sigma0"] if known.get("sigma0") else 0.0
    slow = max(10.0 * known.get("vs", 0.0), presliding * 20.0 * np.pi * f)
    spec.setdefault("speed", slow or 1.0)
    spec.setdefault("bandwidth", min(QUICK, fastest(sensing)))
    spec.setdefault("load", 0.2 * level)
    spec.setdefault("uncertainty", dict.fromkeys(UNCERTAIN, 0.2))
    return DriveSpec(**spec)


def drive_spec(given: Any, own: Mapping[str, Any], motion: str) -> dict[str, Any]:
    """Return the values that are given by name, those of a dict of numbers, or estimates from a
    record; values by name go before the others."""
    said = {k: v for k, v in own.items() if v is not None}
    if isinstance(given, Mapping) and not _holds_arrays(given):
        strange = [k for k in given if k not in KEYS]
        if strange:
            hint = meant(strange[0], KEYS)
            raise InputError(f"record: a drive has no value {shown(strange[0])}; {hint}")
        return _checked({**given, **said})
    if given is None:
        return _checked(said)
    if not is_record(given):
        raise InputError(
            "record must be a record (a path, DataFrame, dict of arrays or Record) or a dict of "
            f"numbers such as {{'rate': 1000}}, not {shown(given)}."
        )
    seen = estimated(as_record(given, motion))
    return seen | _checked({"rate": seen["rate"]} | said)


def _holds_arrays(given: Mapping[Any, Any]) -> bool:
    return any(np.ndim(v) > 0 and not isinstance(v, str) for k, v in given.items()
               if k not in ("measured", "uncertainty"))  # fmt: skip


def estimated(record: Record) -> dict[str, Any]:
    """Return rate, noise, step of the encoder and speed of a record."""
    seen, speed = sensing_of(record), top_speed(record)
    values = {k: getattr(seen, k) for k in ("noise", "resolution", "speed_noise")}
    values["measured"] = tuple(k for k in ("theta", "w") if getattr(record, k) is not None)
    values |= {"speed": speed} if speed else {}
    return values | {"rate": record.rate, "source": record.source}


def _checked(said: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values by name, where all are of their kind."""
    if "rate" not in said:
        raise InputError(
            "rate is missing: give the drive's sample rate in Hz, rate=1000, or a record."
        )
    return {key: CHECKS[key](said[key], key) for key in KEYS if key in said}


def _hertz(value: Any, key: str) -> float:
    return positive(value, key, "Hz")


def _not_negative(value: Any, key: str) -> float:
    if (checked := number(value, key)) < 0.0:
        raise InputError(f"{key} must be 0 or positive, not {shown(value)}.")
    return checked


def _measured(given: Any, _: str) -> tuple[str, ...]:
    words = given.replace(",", " ").split() if isinstance(given, str) else given
    if not isinstance(words, (list, tuple)) or not words or set(words) - {"theta", "w"}:
        raise InputError(f"measured must be 'theta', 'w' or 'theta w', not {shown(given)}.")
    return tuple(k for k in ("theta", "w") if k in words)


def _uncertain(given: Any, _: str) -> dict[str, float]:
    """Return by how much each parameter may be wrong, as a share."""
    if not isinstance(given, Mapping):
        if real(given) == 0.0:
            return dict.fromkeys(UNCERTAIN, 0.0)
        return dict.fromkeys(UNCERTAIN, share(given, "uncertainty"))
    for key in given:
        if key not in UNCERTAIN:
            raise InputError(f"uncertainty: there is no {shown(key)}; {meant(key, UNCERTAIN)}")
    sizes = {k: 0.0 if real(v) == 0.0 else share(v, f"uncertainty of {k}")
             for k, v in given.items()}  # fmt: skip
    return dict.fromkeys(UNCERTAIN, 0.0) | sizes


CHECKS: dict[str, Callable[[Any, str], Any]] = {
    **dict.fromkeys(("rate", "frequency"), _hertz),
    **dict.fromkeys(("speed", "bandwidth"), positive),
    **dict.fromkeys(("noise", "resolution", "speed_noise", "delay"), _not_negative),
    "load": number,
    "measured": _measured,
    "uncertainty": _uncertain,
}

"""What is known of a drive beside its model: rate, sensor, dead time, motion, uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..blocks.aliases import meant
from ..blocks.block import unit_for
from ..core.errors import InputError
from ..core.validation import number, positive, real, share, shown
from ..record import Record
from ..record.as_record import as_record, is_record
from ..simulation.encoder import Sensing
from ..simulation.recorded_sensing import sensing_of

KEYS = (
    *("rate", "noise", "resolution", "speed_noise", "delay", "measured"),
    *("speed", "frequency", "bandwidth", "load", "uncertainty"),
)
UNCERTAIN = ("J", "sigma0", "sigma1", "Fc", "Fs", "Fv", "vs")
USUAL = 0.8  # of a record's speed, for the reference
MOST = 4000  # samples in a period of the reference
LAG, FASTEST = 0.4, 500.0  # rad at the crossover, and its largest value in rad/s


@dataclass(frozen=True)
class DriveSpec:
    """A drive's sensor and task in SI units; None where it follows from the model.

    ``measured``: theta, w or both. ``speed_noise`` None: the speed is the difference of two
    positions. ``source``: where the values come from.
    """

    rate: float
    noise: float = 0.0
    resolution: float = 0.0
    speed_noise: float | None = None
    delay: float = 0.0
    measured: tuple[str, ...] = ("theta", "w")
    speed: float | None = None
    frequency: float | None = None
    bandwidth: float | None = None
    load: float | None = None
    uncertainty: Mapping[str, float] | None = None
    source: str = "the arguments"

    @property
    def sensing(self) -> Sensing:
        """The same for the simulation."""
        return Sensing(1.0 / self.rate, self.noise, self.resolution, self.speed_noise, self.delay)

    def completed(self, known: Mapping[str, float]) -> DriveSpec:
        """All values, those that are not given by the drive's parameters ``known``."""
        f = self.frequency or max(1.0, self.rate / MOST)
        late = 0.5 / self.rate * (1.0 + (self.speed_noise is None)) + self.delay
        level = max(known.get("Fc", 0.0), known.get("Fs", 0.0))
        slow = max(10.0 * known.get("vs", 0.0), _presliding(known, level) * 20.0 * np.pi * f)
        return replace(
            self,
            frequency=f,
            speed=self.speed or slow or 1.0,
            bandwidth=self.bandwidth or min(FASTEST, LAG / late),
            load=0.2 * level if self.load is None else self.load,
            uncertainty=self.uncertainty or dict.fromkeys(UNCERTAIN, 0.2),
        )


def _presliding(known: Mapping[str, float], level: float) -> float:
    return level / known["sigma0"] if known.get("sigma0") else 0.0


def drive_spec(given: Any, own: Mapping[str, Any], motion: str) -> DriveSpec:
    """The values given by name, those of a dict of numbers, or estimates from a record.

    Values by name go before those of the record.
    """
    said = {k: v for k, v in own.items() if v is not None}
    if given is None:
        return _of_values(said, None)
    if isinstance(given, Mapping) and not _holds_arrays(given):
        strange = [k for k in given if k not in KEYS]
        if strange:
            hint = meant(strange[0], KEYS)
            raise InputError(f"record: a drive has no value {shown(strange[0])}; {hint}")
        return _of_values({**given, **said}, None)
    if not is_record(given):
        raise InputError(
            "record must be a record (a path, DataFrame, dict of arrays or Record) or a dict of "
            f"numbers such as {{'rate': 1000}}, not {shown(given)}."
        )
    return _of_values(said, estimated(as_record(given, motion)))


def _holds_arrays(given: Mapping[Any, Any]) -> bool:
    return any(np.ndim(v) > 0 and not isinstance(v, str) for k, v in given.items()
               if k not in ("measured", "uncertainty"))  # fmt: skip


def estimated(record: Record) -> DriveSpec:
    """Rate, noise, step of the encoder and speed of a record."""
    seen = sensing_of(record)
    here = tuple(k for k in ("theta", "w") if getattr(record, k) is not None)
    fast = USUAL * _fast(record)
    return DriveSpec(
        record.rate,
        noise=seen.noise,
        resolution=seen.resolution,
        speed_noise=seen.speed_noise,
        measured=here,
        speed=fast or None,
        source=record.source,
    )


def _fast(record: Record) -> float:
    """The speed that the record exceeds in a twentieth of its time."""
    w = record.w
    if w is None and record.theta is not None:
        n = max(1, round(0.02 / record.dt))
        w = (record.theta[n:] - record.theta[:-n]) / (n * record.dt)
    return 0.0 if w is None or not len(w) else float(np.quantile(np.abs(w), 0.95))


def _of_values(said: Mapping[str, Any], known: DriveSpec | None) -> DriveSpec:
    """The values by name, checked, in place of those that are known."""
    if known is None and "rate" not in said:
        raise InputError(
            "rate is missing: give the drive's sample rate in Hz, rate=1000, or a record."
        )
    made: dict[str, Any] = {}
    for key in ("rate", "speed", "frequency", "bandwidth"):
        if key in said:
            unit = "Hz" if key in ("rate", "frequency") else ""
            made[key] = positive(said[key], key, unit)
    for key in ("noise", "resolution", "speed_noise", "delay"):
        if key in said:
            made[key] = number(said[key], key)
            if made[key] < 0.0:
                raise InputError(f"{key} must be 0 or positive, not {shown(said[key])}.")
    if "load" in said:
        made["load"] = number(said["load"], "load")
    if "measured" in said:
        made["measured"] = _measured(said["measured"])
    if "uncertainty" in said:
        made["uncertainty"] = _uncertain(said["uncertainty"])
    return replace(known, **made) if known else DriveSpec(**made)


def _measured(given: Any) -> tuple[str, ...]:
    words = given.replace(",", " ").split() if isinstance(given, str) else given
    if not isinstance(words, (list, tuple)) or not words or set(words) - {"theta", "w"}:
        raise InputError(f"measured must be 'theta', 'w' or 'theta w', not {shown(given)}.")
    return tuple(k for k in ("theta", "w") if k in words)


def _uncertain(given: Any) -> dict[str, float]:
    """By how much each parameter may be wrong, as a share."""
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


def units(motion: str) -> dict[str, str]:
    """The units of speed, position and torque."""
    return {k: unit_for(u, motion) for k, u in
            {"w": "rad/s", "theta": "rad", "u": "N m"}.items()}  # fmt: skip

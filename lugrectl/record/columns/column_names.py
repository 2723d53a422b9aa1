"""What the name of a column says: its unit, and the role that its words usually stand for."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from .units import ROLES, UNITS, Unit, fits, parse_unit


# Usual names by role, lower case, first choice first, with the unit that the name alone implies.
def _names(*words: str, unit: str | None = None) -> dict[str, str | None]:
    return dict.fromkeys(words, unit)


_USUAL: dict[str, tuple[dict[str, str | None], ...]] = {
    "t": (
        _names("time", "zeit", "seconds", "secs"),
        _names("timestamp", "stamp", "datetime", "clock", "elapsed"),
        _names("x_value", "x value", "date time", "date/time", "date"),
    ),
    "u": (
        _names("torque", "force", "tau", "moment", "effort", "trq", "drehmoment", "kraft"),
        _names("current", "iq", "i_q", "strom", "motorstrom", unit="A"),
        _names("voltage", "vir", "spannung", unit="V"),
    ),
    "w": (
        _names("speed", "velocity", "vel", "omega", "qd", "dq", "dtheta", "theta_dot", "thetadot")
        | _names("drehzahl", "geschwindigkeit"),
        {"rpm": "rpm", "erpm": "eRPM"},
    ),
    "theta": (_names("position", "pos", "angle", "q", "qm", "phi", "displacement", "x", "winkel"),),
    "r": (),
    "d": (),
    "temperature": (_names("temp"),),
    "theta_load": (),
}
_LAST = {"u": {"F": "N"}, "w": {"v": None}}  # as they are written: of a linear axis
# Words that may be part of a column's name without changing its meaning.
_NEUTRAL = frozenset(
    "actual value values averaged average avg mean measured meas motor joint shaft axis drive "
    "feedback raw filtered signal signals act applied estimate estimated est encoder sensor "
    "angular present data m state states field".split()
)
_OF_TIME = frozenset("elapsed relative local system log".split())
_DEMANDED = frozenset(
    "command commanded cmd reference ref desired des target setpoint set goal demand error err "
    "limit max min std offset".split()
)
_PART, _FAR = 5, 10  # a name in a path fits less well than the name itself; a demand, still less
_LENGTHS = frozenset("x displacement".split())  # the only names that _m gives metres to


def usual_unit(role: str, name: str) -> str | None:
    """The unit that a usual name alone implies: A for a current."""
    last = _LAST.get(role, {}).get(name)
    return next((names[name.lower()] for names in _USUAL[role] if name.lower() in names), last)


def usual_names(role: str) -> list[str]:
    return [name for names in _USUAL[role] for name in names]


def split_unit(header: str) -> tuple[str, str | None]:
    """Split 'name [unit]' or 'name (unit)'; None without one, as in position[0] or (measured)."""
    header = header.strip()
    match = re.fullmatch(r"(.*?)(\s*)(?:\[([^\[\]]*)\]|\(([^()]*)\)|<([^<>]*)>)", header)
    if match is None:
        return header, None
    unit = (match[3] or match[4] or match[5] or "").strip()
    if unit.isdigit() and not match[2]:
        return header, None
    if unit and parse_unit(unit) is None and set(_words(unit)) <= _NEUTRAL | _DEMANDED:
        return header, None
    return match[1], unit or None


def unit_in_name(name: str) -> tuple[str, str | None]:
    """Split torque_mNm, 'angle, deg' or speedRpm into name and unit, if a channel can be in it."""
    for at in re.finditer(r"\s*[,/|]\s*|[_\s-]+|(?<=[a-z])(?=[A-Z])", name):
        plain, text = name[: at.start()], name[at.end() :]
        if not plain or not text or (text == "m" and plain.lower() not in _LENGTHS):  # measured
            continue
        roles = [role for role in ROLES if rank(plain, role) is not None]
        for unit in _meant(text):
            if any(fits(role, unit) for role in roles):
                return plain, unit.name
    return name, None


def _meant(text: str) -> list[Unit]:
    """The unit that is written, or those that differ from the text in upper and lower case."""
    unit = parse_unit(text)
    if unit is not None:
        return [unit]
    bare = re.sub(r"[\s_]", "", text).lower()
    return [u for u in UNITS.values() if len(bare) > 1 and u.name.replace(" ", "").lower() == bare]


def fitting(plain: Sequence[str], role: str, free: Sequence[int]) -> tuple[list[int], str | None]:
    """Return the columns that may be the role, best match only, and the unit they imply."""
    ranks = {i: r for i in free if (r := rank(plain[i], role)) is not None}
    if not ranks:
        return [], None
    best = min(r[0] for r in ranks.values())
    fits_best = [i for i, r in ranks.items() if r[0] == best]
    return fits_best, ranks[fits_best[0]][1]


def rank(name: str, role: str) -> tuple[tuple[int, int], str | None] | None:
    """How well a name fits a role, smaller is better, and the unit it implies; None if not. Of a
    path such as /joint_states/elbow/position its last part counts that is no word such as data."""
    whole = _rank_plain(name, role)
    if whole is not None:
        return whole
    parts = [p for p in re.split(r"[/.:]+|\[[^\]]*\]", name.strip("%_ ")) if p.strip()]
    parts = [re.sub(r"(?<=[a-z])\d+$", "", part.strip()) for part in parts]
    while len(parts) > 1 and not set(_words(parts[-1])) - _NEUTRAL:
        parts.pop()
    if not parts or parts == [name]:
        return None
    demanded = bool({word for part in parts for word in _words(part)} & _DEMANDED)
    leaf = _rank_plain(parts[-1], role)
    if leaf is None or (demanded and role != "u"):
        return None
    (tier, how), implied = leaf
    return (tier, how + (_FAR if demanded else _PART)), implied


def _rank_plain(name: str, role: str) -> tuple[tuple[int, int], str | None] | None:
    lower = name.lower()
    if name == role:
        return (-1, 0), None
    if len(role) > 1 and lower == role:
        return (-1, 1), None
    if role in ("u", "w") and name == role.upper():
        return (-1, 2), None
    if name in _LAST.get(role, ()):
        return (_FAR, 0), _LAST[role][name]
    rest = set(_words(name)) - _NEUTRAL - (_OF_TIME if role == "t" else frozenset())
    key = rest.pop() if len(rest) == 1 else None  # as in 'Torque actual value averaged'
    for tier, names in enumerate(_USUAL[role]):
        if lower in names:
            return (tier, 0), names[lower]
        if key is not None and key in names:
            return (tier, 1), names[key]
    return ((0, 1), None) if len(role) > 1 and key == role else None


def _words(name: str) -> list[str]:
    """The words of a name in lower case; camelCase is split, numbers are left out."""
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    words = re.split(r"[\W_]+", spaced.lower())
    words = [re.sub(r"\d+$", "", word) for word in words]
    return [word for word in words if word]


def stamp_pair(names: Sequence[str]) -> Mapping[str, tuple[int, int, float]]:
    """Times in two columns, whole seconds and their rest: name -> (seconds, rest, unit in s)."""
    places = {name: i for i, name in enumerate(names)}
    found = {}
    for name, i in places.items():
        match = re.fullmatch(r"(.*?)(sec|secs|seconds)", name)
        if match is None:
            continue
        for ending, unit in (("nanosec", 1e-9), ("nsec", 1e-9), ("nsecs", 1e-9), ("usec", 1e-6)):
            rest = places.get(match[1] + ending)
            if rest is not None and rest != i:
                found[match[1].strip("._/ ") or "stamp"] = (i, rest, unit)
    return found

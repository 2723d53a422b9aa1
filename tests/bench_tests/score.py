"""The package's answers to drawn bench tests, value by value, beside the hidden truth.

    python -m tests.bench_tests.score [KIND...] [--seeds 1-10]

Each record is written as files and diagnosed as a user would. Three columns are scored: ``bench``
(``plain["bench_tests"]``, the entries of the record's kind), ``plain`` (``plain["parameters"]``,
their quotients by J, and the combinations that mean an asked value) and ``fit`` (``parameters`` of
the finer fit). A value that is absent is "not given", which is not wrong. ``right`` is within 3 %,
``inside`` within its interval, ``both`` the two. ``other kind`` counts bench tests seen that the
record is not, ``wrong name`` the records ``found`` with an effect that is not there.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .drawn import KINDS, Drawn, draw

UNITS = {"t": "s", "u": "N m", "theta": "rad", "w": "rad/s"}
COLUMNS = ("bench", "plain", "fit")
COUNTS = (
    "asked",
    "right",
    "inside",
    "both",
    "wrong",
    "not given",
    "zero width",
    "other kind",
    "wrong name",
)


@dataclass
class Value:
    """What was said of one asked value."""

    name: str
    truth: float
    said: dict | None

    @property
    def width(self) -> float:
        low, high = ends(self.said)
        return high - low

    @property
    def off(self) -> float:
        return self.said["value"] / self.truth - 1

    @property
    def right(self) -> bool:
        return abs(self.off) <= 0.03

    @property
    def inside(self) -> bool:
        low, high = ends(self.said)
        return low <= self.truth <= high

    @property
    def outcome(self) -> list[str]:
        """Those of COUNTS that hold."""
        if self.said is None:
            return ["asked", "not given"]
        right, inside = self.right, self.inside
        held = {"right": right, "inside": inside, "both": right and inside, "wrong": not right}
        held |= {"asked": True, "zero width": self.width <= 0}
        return [name for name, true in held.items() if true]

    def __str__(self) -> str:
        if self.said is None:
            return f"{self.name} not given"
        half = self.width / 2 / abs(self.truth)
        mark = "" if self.right and self.inside else " inside" if self.inside else " OUT"
        return f"{self.name} {100 * self.off:+.2g} % (+-{100 * half:.2g}){mark}"


def ends(said: dict) -> tuple[float, float]:
    """The interval; an end that is not given is open."""
    low, high = said.get("ci95") or (None, None)
    return float(-np.inf if low is None else low), float(np.inf if high is None else high)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=KINDS)
    parser.add_argument("--seeds", default="1-10")
    options = parser.parse_args()
    first, last = (int(part) for part in options.seeds.split("-"))
    tables: dict[str, dict[str, Counter]] = {}
    for kind in options.kinds:
        tables[kind] = {column: Counter() for column in COLUMNS}
        for seed in range(first, last + 1):
            one(draw(kind, seed), tables[kind])
    for column in COLUMNS:
        print(f"\n{column:18}" + "".join(f"{name:>12}" for name in COUNTS))
        for kind, table in tables.items():
            print(f"{kind:18}" + "".join(f"{table[column][name]:12}" for name in COUNTS))


def one(drawn: Drawn, tables: dict[str, Counter]) -> None:
    """Ask for one record, print what came, count it."""
    report = diagnosed(drawn)
    plain = report["plain"] or {}
    of_kind, others = bench(plain, drawn.kind)
    said = {"bench": of_kind, "plain": parameters(plain, drawn)}
    said["fit"] = parameters({"parameters": report["parameters"]}, drawn)
    named = {effect["name"] for effect in report["effects"]} if report["verdict"] == "found" else {}
    print(f"\n{drawn}: {report['verdict']} {', '.join(named)}")
    if wrong := set(named) - true_names(drawn):
        print(f"  wrong name: {', '.join(wrong)}")
    tables["bench"]["other kind"] += len(others)
    tables["fit"]["wrong name"] += bool(wrong)
    for column, values in said.items():
        found = [asked(name, truth, values, drawn) for name, truth in drawn.truth.items()]
        for value in found:
            tables[column].update(value.outcome)
        print(f"  {column}: " + "; ".join(map(str, found)))
    if others:
        print(f"  taken for: {others}")
    for message in filter(None, [report["reason"], *report["messages"]]):
        print(f"    {message}", flush=True)


def asked(name: str, truth: float, values: dict, drawn: Drawn) -> Value:
    """The value of this name; a scatter may be said as a share of Fs."""
    said = values.get(name)
    if said and name == "Fs_scatter" and said["unit"] in ("%", "1", ""):
        level = (drawn.truth["Fs_forward"] + drawn.truth["Fs_backward"]) / 2
        level /= 100 if said["unit"] == "%" else 1
        said = {"value": said["value"] * level, "ci95": [x * level for x in ends(said)]}
    return Value(name, truth, said)


def bench(plain: dict, kind: str) -> tuple[dict, list[str]]:
    """The values that stand under the record's kind, and the other kinds that were named."""
    entries = plain.get("bench_tests") or []
    values = [entry["values"] for entry in entries if entry["kind"] == kind]
    merged = {name: value for more in values for name, value in more.items()}
    return merged, [entry["kind"] for entry in entries if entry["kind"] != kind]


def parameters(plain: dict, drawn: Drawn) -> dict:
    """The plain values that an asked name means; of a slow scan Fc holds Fv w."""
    values = dict(plain.get("parameters") or {})
    for sum_ in plain.get("combinations") or []:
        level = sum_["text"].startswith("Fc + ") and sum_["text"].endswith(" Fv")
        values["Fc" if level else sum_["text"].replace(" ", "")] = sum_
    if drawn.kind == "slow_scan" and {"Fc", "Fv"} <= set(values):
        more = values["Fv"]["value"] * np.abs(drawn.hints["reference"]).max()
        Fc = values["Fc"]
        values["Fc"] = {"value": Fc["value"] + more, "ci95": [x + more for x in ends(Fc)]}
    return ratios(values) | values


def ratios(values: dict) -> dict:
    """Fc/J and Fv/J where both are given, as a user would divide them."""
    found = {}
    for name in {"Fc", "Fv"} & set(values) if "J" in values else ():
        above, J = values[name], values["J"]
        value = above["value"] / J["value"]
        shares = [np.ptp(ends(x)) / 2 / x["value"] for x in (above, J)]
        half = np.hypot(*shares) * abs(value)
        found[f"{name}/J"] = {"value": value, "ci95": [value - half, value + half]}
    return found


def true_names(drawn: Drawn) -> set[str]:
    """The effects that a right answer may name, beside those of the model file."""
    m, stepped = drawn.machine, drawn.sensors.speed in ("difference", "stale")
    names = {"stribeck": True, "velocity_sensor_lag": stepped, "gravity": m.waves[:1]}
    names |= {"torque_ripple": m.waves, "coulomb_asymmetry": m.backward}
    names |= {"position_dependent_friction": m.variation}
    return {name for name, there in names.items() if there}


def diagnosed(drawn: Drawn) -> dict:
    """The JSON of the diagnosis of the record's files."""
    import lugrectl as lg

    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"run{i + 1}.csv" for i in range(len(drawn.runs))]
        for file, run in zip(files, drawn.runs, strict=True):
            head = ",".join(f"{name} [{UNITS[name]}]" for name in run)
            rows = np.stack(list(run.values()), 1)
            np.savetxt(file, rows, "%.9g", ",", header=head, comments="")
        model = Path(folder) / "model.toml"
        model.write_text(toml(drawn.known), encoding="utf-8")
        with warnings.catch_warnings(record=True) as raised:
            warnings.simplefilter("always")
            report = lg.diagnose(files if len(files) > 1 else files[0], model).to_dict()
    report["messages"] += [f"{w.category.__name__}: {w.message}" for w in raised]
    return report


def toml(known: dict) -> str:
    """The model file."""
    lines = []
    for table, values in known.items():
        for block in values if isinstance(values, list) else [values]:
            lines.append(f"[[{table}]]" if isinstance(values, list) else f"[{table}]")
            lines += [
                f'{key} = "{v}"' if isinstance(v, str) else f"{key} = {float(v)!r}"
                for key, v in block.items()
            ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()

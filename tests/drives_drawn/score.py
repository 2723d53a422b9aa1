"""How right the plain answer is on drawn drives, and whether its intervals can be believed.

python -m tests.drives_drawn.score --seeds A:B --kind messy [--damage KIND] --out FILE.jsonl
"""

from __future__ import annotations

import argparse
import json
import time
import traceback
import warnings
from pathlib import Path

import numpy as np

from .. import held_out
from . import DAMAGES, KINDS, damage, draw
from .answers import answer, answer_of_file

SCORED = ("J", "Fc", "Fv", "constant_torque", "gravity.amplitude", "gravity.phase", "delay")
SCORED += ("u_delay",)
RESULTS = Path(__file__).parents[2] / "notebooks" / "results" / "plain.json"
DAMAGED_RIGHT = {"J": 3.0, "Fc": 3.0, "Fv": 5.0}  # %, of a log that was damaged


def scale(name: str, truth: dict) -> float:
    """What 100 % of an error is: the value; Fc of a constant torque; a row of a delay; a radian."""
    if name == "constant_torque":
        return truth["about"]["machine"]["Fc"]
    if name in ("delay", "u_delay"):
        return truth["about"]["dt"]
    return 1.0 if name == "gravity.phase" else abs(truth[name])


def compare(found: dict, truth: dict) -> dict:
    """Per value with a truth: error and half-width in %, and whether the truth is inside.

    None for a value that was not given.
    """
    out = {}
    for name in (n for n in SCORED if n in truth):
        if name not in found:
            out[name] = None
            continue
        value, low, high = (float(x) for x in found[name])
        off, of = value - truth[name], scale(name, truth)
        if name == "gravity.phase":
            off = float(np.angle(np.exp(1j * off)))
        inside = low - value <= -off <= high - value
        numbers = {"error": 100 * off / of, "half": 50 * (high - low) / of}
        out[name] = numbers | {"inside": bool(inside), "value": value, "true": truth[name]}
    return out


def second(seed: int, kind: str) -> tuple[dict, dict]:
    """A drive of the second rig, its truth in the names of the first."""
    log, known = held_out.draw(seed, "plain" if kind == "clean" else "real")
    truth = {name: known[name] for name in ("J", "Fc", "Fv")}
    size, phase = known["gravity"]
    if size > 0.1 * known["Fc"]:
        truth |= {"gravity.amplitude": size, "gravity.phase": phase}
    truth["constant_torque"] = known["const"] + known["u_offset"]
    machine = {"Fc": known["Fc"], "law": known["friction"]}
    truth["about"] = {"machine": machine, "dt": 1.0 / known["fs"], "task": known["motion"]}
    return log, truth


def score(seed: int, kind: str, hurt: str | None, say, drawn=draw) -> dict | None:
    """One drive: its comparison and the CPU seconds; None where the damage does not apply."""
    log, truth = drawn(seed, kind)
    if hurt:
        try:
            log = damage(log, hurt, seed)
        except ValueError:
            return None
    row = {"seed": seed, "kind": kind, "damage": hurt, "crash": None}
    row["task"], row["law"] = truth["about"]["task"], truth["about"]["machine"]["law"]
    began = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = say(log, damaged=bool(hurt))
    except Exception as error:  # a crash is a result
        found = {}
        row["crash"] = "".join(traceback.format_exception_only(error)).strip()
    row["cpu"] = time.process_time() - began
    return row | {"values": compare(found, truth), "notes": list(found.get("notes", []))}


def table(rows: list[dict]) -> str:
    """Coverage, errors and half-widths of each value over all drives, one line each."""
    head = f"{'':18s}{'drives':>7s}{'given':>7s}{'inside':>8s}{'right':>7s}"
    head += f"{'error: median':>15s}{'90 %':>9s}{'worst':>9s}{'half-width':>12s}"
    lines = [head]
    for name in SCORED:
        values = [r["values"][name] for r in rows if name in r["values"]]
        given = [v for v in values if v]
        if not given:
            continue
        errors = np.array([abs(v["error"]) for v in given])
        numbers = [np.median(errors), np.quantile(errors, 0.9), errors.max()]
        half = np.median([v["half"] for v in given])
        inside = 100 * np.mean([v["inside"] for v in given])
        good = 100 * np.mean([right(name, v) for v in values])
        line = f"{name:18s}{len(values):7d}{len(given):7d}{inside:7.1f}%{good:6.1f}%"
        lines.append(line + "{:14.3g}%{:8.3g}%{:8.3g}%".format(*numbers) + f"{half:11.3g}%")
    cpu = np.array([r["cpu"] for r in rows])
    lines.append(f"CPU seconds: median {np.median(cpu):.2f}, worst {cpu.max():.2f}")
    crashes = [r for r in rows if r["crash"]]
    lines += [f"seed {r['seed']}: {r['crash']}" for r in crashes]
    return "\n".join(lines)


def summary(rows: list[dict]) -> dict:
    """The figures of :func:`table` for J, Fc and Fv as plain numbers."""
    made = {"drives": len(rows), "cpu": float(np.median([r["cpu"] for r in rows]))}
    for name in DAMAGED_RIGHT:
        given = [v for r in rows if (v := r["values"].get(name))]
        made[name] = {
            "given": len(given),
            "known": sum(name in r["values"] for r in rows),
            "inside": float(np.mean([v["inside"] for v in given])),
            "error": float(np.median([abs(v["error"]) for v in given])),
            "half": float(np.median([v["half"] for v in given])),
        }
    return made


def keep(path: Path, key: str, commit: str, rows: list[dict]) -> None:
    """Put a summary into a file of results, beside those of other runs."""
    known = json.loads(path.read_text()) if path.exists() else {}
    known[key] = {"commit": commit} | summary(rows)
    path.write_text(json.dumps(known, indent=1) + "\n")


def right(name: str, value: dict | None) -> bool:
    """Close to the truth, or inside an interval of at most 20 %; a value not given is not."""
    if value is None:
        return False
    near = abs(value["error"]) <= DAMAGED_RIGHT.get(name, 5.0)
    return near or (value["inside"] and value["half"] <= 20.0)


def misses(rows: list[dict]) -> str:
    """The values whose interval leaves the truth out, worst first, and what was noted there."""
    out = []
    for row in rows:
        for name, v in row["values"].items():
            if v and not v["inside"]:
                text = f"seed {row['seed']} ({row['task']}, {row['law']}): {name}"
                text += f" {v['error']:+.3g}% +-{v['half']:.3g}%"
                text += "".join(f"\n    {note}" for note in row["notes"])
                out.append((abs(v["error"]) / max(v["half"], 1e-9), text))
    return "\n".join(text for _, text in sorted(out, reverse=True))


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.drives_drawn.score")
    parser.add_argument("--seeds", default="0:20", help="from:to, the last one left out")
    parser.add_argument("--kind", default="clean", choices=KINDS)
    parser.add_argument("--rig", default="first", choices=("first", "second"))
    parser.add_argument("--damage", choices=[*DAMAGES, "all"], help="hurt each log in this way")
    parser.add_argument("--out", type=Path, help="a line of JSON for each drive")
    parser.add_argument("--keep", metavar="COMMIT", help=f"put the summary into {RESULTS.name}")
    parser.add_argument("--prototype", type=Path, help="a file whose balance(log) answers instead")
    parser.add_argument("--misses", action="store_true", help="name each value that is outside")
    given = parser.parse_args(arguments)
    say = answer_of_file(given.prototype) if given.prototype else answer
    kinds = list(DAMAGES) if given.damage == "all" else [given.damage]
    seeds = range(*(int(x) for x in given.seeds.split(":")))
    drawn = second if given.drives == "second" else draw
    rows = []
    for hurt in kinds:
        some = [score(seed, given.kind, hurt, say, drawn) for seed in seeds]
        some = [row for row in some if row]
        rows += some
        if len(kinds) > 1:
            print(f"--- {hurt}\n{table(some) if some else 'no log has such a column'}", flush=True)
    if given.keep:
        keep(RESULTS, f"{given.drives} rig, {given.kind}, seeds {given.seeds}", given.keep, rows)
    if given.out:
        given.out.write_text("".join(json.dumps(row) + "\n" for row in rows))
    print(f"{given.drives} rig, {given.kind}, seeds {given.seeds}, damage {given.damage}.")
    print("Errors in % (a constant torque: of Fc; a phase: of a radian; a delay: of a row);")
    print("intervals of 95 %")
    print(table(rows))
    if given.misses:
        print(misses(rows))


if __name__ == "__main__":
    main()

"""Statements of the source paper that can be checked by simulation, and what was found."""

from __future__ import annotations

from collections.abc import Iterator

from .results import FAILS, HOLDS, Claim, Reproduction, milli, width_of


def claims(r: Reproduction) -> tuple[Claim, ...]:
    """The statements of the paper that can be checked by simulation."""
    made = list(_bandwidth_claims(r))
    if figure := r.figure("velocity"):
        none, best = (milli(list(figure.errors.values())[i]) for i in (1, 2))
        made.append(
            Claim(
                "Velocity: friction degrades the PI severely, the proposed observer is a remedy",
                f"{none} against {best} mrad/s RMS, with exact observer parameters, where the "
                "natural observer does the same; with wrong ones see the tables",
                HOLDS,
            )
        )
    if figure := r.figure("position"):
        none, best = (milli(list(figure.errors.values())[i]) for i in (1, 2))
        made.append(
            Claim(
                "Position: the proposed observer performs well",
                f"{best} mrad RMS over 1 to 5 s, {none} with no observer (step of 1 rad, "
                "prefilter, exact parameters); later it grows without bound",
                FAILS,
            )
        )
    if r.growth:
        made.append(
            Claim(
                "(not in the paper) growth of the compensated position loop",
                f"time constant {r.growth.predicted:.2f} s from the poles, "
                f"{r.growth.simulated:.2f} s in simulation over {r.growth.window[0]:g} to "
                f"{r.growth.window[1]:g} s with the {r.growth.observer}",
                "unstable",
            )
        )
    return tuple(made)


def _bandwidth_claims(r: Reproduction) -> Iterator[Claim]:
    v, half = (width_of(r, "velocity", "paper's PI", level) for level in ("-3dB", "half-power"))
    left = width_of(r, "velocity", "paper's PI, Fv left in")
    yield Claim(
        "Velocity PI: around 115 Hz at -3 dB",
        f"{v.hertz:.1f} Hz (half power {half.hertz:.1f} Hz; Fv left in {left.hertz:.1f} Hz)",
        HOLDS,
    )
    pi, left = (width_of(r, "position", f"paper's PI{x}") for x in ("", ", Fv left in"))
    yield Claim(
        "Position PI: approximately 20 Hz",
        f"|T| crosses -3 dB at {pi.hertz:.1f} Hz, but the loop is unstable and has no bandwidth; "
        f"stable with Fv left uncompensated (Fv Kp > J Ki, {left.hertz:.1f} Hz)",
        FAILS,
    )

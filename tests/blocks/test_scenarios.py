"""The figures of observers and controllers in the scenarios in which they compete."""

from dataclasses import replace

import numpy as np
import pytest

import lugrectl as lg

from ..cases.observed import (
    STEP,
    P,
    believing,
    cycle,
    follower,
    longer,
    position_error,
    signals_by,
    sine,
    velocity_error,
)
from ..cases.wired import joined

LOW = believing(0.8)
PLACED = {"l1": 2719.1, "l2": 2.118e6, "l3": -5742.4}  # three poles at -1000 1/s at rest
SCALED = replace(P, **{k: 0.8 * getattr(P, k) for k in ("sigma0", "sigma1", "Fc", "Fs")})
VELOCITY = [  # observer, what it believes, its gains, RMS of e in rad/s, unit of the last digit
    (None, LOW, {}, 0.0699, 1e-4),
    ("natural", LOW, {}, 0.0313, 1e-4),
    ("proposed", LOW, {}, 0.0116, 1e-4),
    ("temperature", LOW, {}, 0.00061, 1e-5),  # as with exact parameters
    ("temperature", believing(0.8, J=1.2 * P.J), {}, 0.00073, 1e-5),
    ("temperature", believing(0.8, sigma1=0.5 * P.sigma1), {}, 0.0021, 1e-4),
    ("temperature", believing(0.8, Fv=0.0), {}, 0.00072, 1e-5),
    ("temperature", replace(P, Fc=0.8 * P.Fc, Fs=0.8 * P.Fc), {}, 0.00066, 1e-5),
    ("temperature", believing(0.8, sigma0=0.7 * P.sigma0), {}, 0.0178, 1e-4),
    ("friction_state", P, {"bandwidth": 200.0}, 0.0014, 1e-4),
    ("friction_state", LOW, {"bandwidth": 200.0}, 0.0128, 1e-4),
    ("friction_state", P, {"bandwidth": 2000.0}, 0.00068, 1e-5),
    ("friction_state", LOW, {"bandwidth": 2000.0}, 0.0025, 1e-4),
    ("lyapunov", P, {"k": 0.35}, 0.00028, 1e-5),
    ("lyapunov", LOW, {"k": 0.35}, 0.0186, 1e-4),
    ("existing", P, {"k": 0.35}, 0.00025, 1e-5),
    ("existing", LOW, {"k": 0.35}, 0.0165, 1e-4),
    ("existing", LOW, {"k": 20.0}, 0.00083, 1e-5),  # with wrong levels better than lyapunov
    ("general_coulomb", P, {"k": 0.11, "w0": 0.1}, 0.0216, 1e-4),
    ("general_coulomb", P, {"k": 1.1, "w0": 0.01}, 0.0090, 1e-4),
    ("friedland_park", P, {"k": 0.11}, 0.0214, 1e-4),
    ("position_coulomb", P, {"k": 0.11, "L": 400.0}, 0.0088, 1e-4),
    ("position_coulomb", LOW, {"k": 0.11, "L": 400.0}, 0.0088, 1e-4),  # whatever the level
    ("position_lugre", P, {}, 0.00061, 1e-5),
    ("position_lugre", LOW, {}, 0.0235, 1e-4),
    ("position_lugre", LOW, PLACED, 0.0080, 1e-4),
]


SEEN, RARELY = (None, "temperature", "existing"), [pytest.mark.slow, pytest.mark.sample]
ROWS = [pytest.param(*row, marks=[] if row[0] in SEEN else RARELY) for row in VELOCITY]


@pytest.mark.parametrize(("name", "believed", "gains", "error", "digit"), ROWS)
def test_in_the_velocity_loop(name, believed, gains, error, digit):
    assert velocity_error(name, believed, gains=gains) == pytest.approx(error, abs=digit)


FLOOR = 2.3e-7, 1e-8  # rad: that of exact parameters


def wired(controller, estimate=None, lam=20.0):
    """A controller on s around the drive, with or without Fhat."""
    with_it = [] if estimate is None else [estimate, lg.compensation()]
    parts = [lg.plant(P), lg.sliding_error(lam), lg.error("position"), controller, *with_it]
    return joined(parts, ["r", "dr", "ddr"], ["theta", "w", "F", "u", "e"])


def on_s(k, p=LOW):
    """The existing observer, corrected by s."""
    return lg.existing_observer(p, k, inputs=["w", "s"])


def stiff(k):
    """A Slotine-Li controller with the feedback that the existing observer adds by k."""
    return lg.slotine_li(P, 0.1 + P.sigma1 * k)


ESO, SMC = lg.extended_state_observer, lg.backstepping_smc
POSITION = {  # the loop, RMS of theta - r in rad, and how well it is known
    "temperature, low": (lambda: follower(lg.temperature_observer(LOW)), FLOOR),
    "natural, low": (lambda: follower(lg.natural_observer(LOW)), (3.1e-3, 1e-4)),
    "normal force": (lambda: follower(lg.normal_force_observer(SCALED)), FLOOR),
    "normal force, 2e5": (lambda: follower(lg.normal_force_observer(SCALED, gamma=2e5)), FLOOR),
    "natural, scaled": (lambda: follower(lg.natural_observer(SCALED)), (3.1e-3, 1e-4)),
    "existing, scaled": (lambda: follower(lg.existing_observer(SCALED, k=1.0)), (3.0e-3, 1e-4)),
    "position Coulomb": (lambda: follower(lg.position_coulomb_observer(P)), (2.9e-4, 1e-5)),
    "position LuGre": (lambda: follower(lg.position_lugre_observer(P)), FLOOR),
    "position LuGre, low": (lambda: follower(lg.position_lugre_observer(LOW)), (3.1e-3, 1e-4)),
    "Slotine-Li, exact": (lambda: wired(lg.slotine_li(P), on_s(0.35, P)), FLOOR),
    "Slotine-Li, existing": (lambda: wired(lg.slotine_li(P), on_s(0.35)), (8.8e-3, 9e-5)),
    "Slotine-Li, existing, 50": (lambda: wired(lg.slotine_li(P), on_s(50.0)), (1.05e-4, 1e-6)),
    "Slotine-Li, natural": (lambda: wired(stiff(0.35), lg.natural_observer(LOW)), (8.1e-3, 8e-5)),
    "Slotine-Li, natural, 50": (lambda: wired(stiff(50), lg.natural_observer(LOW)), (8.4e-5, 8e-7)),
    **{
        f"Slotine-Li, lyapunov, {k}": (
            lambda k=k: wired(lg.slotine_li(P), lg.lyapunov_observer(LOW, k)),
            (error, 0.03 * error),
        )
        for k, error in ((0.35, 1.8e-2), (5.0, 8.9e-3), (50.0, 5.1e-3))
    },
    "adaptive": (lambda: wired(lg.adaptive_slotine_li()), (2.7e-3, 5e-4)),  # tanh, not bristles
    "adaptive, off": (lambda: wired(lg.adaptive_slotine_li(gJ=0, gv=0, gc=0)), (7.0e-2, 1.4e-3)),
    "backstepping": (lambda: wired(SMC(P)), (1.2e-2, 5e-4)),  # without an observer it must switch
    "backstepping, hard": (lambda: wired(SMC(P, eps=200.0)), (6.5e-5, 1e-6)),
    "backstepping, 1000": (lambda: wired(SMC(P), ESO(P, 1000.0)), (2.4e-4, 7e-6)),
}


@longer
@pytest.mark.parametrize(("make", "error"), POSITION.values(), ids=POSITION)
def test_in_the_position_loop(make, error):
    assert position_error(make()) == pytest.approx(error[0], abs=error[1])


@longer
def test_dual_observer_control_follows_without_sigma0_sigma1_Fv():
    """And whatever the level: the error goes on falling, faster with higher gains."""
    fast = lg.dual_observer_control(P, g0=1e7, g1=10.0, g2=1.0)
    made = [lg.dual_observer_control(P), lg.dual_observer_control(LOW), fast]
    found, low, fast = (position_error(wired(one)) for one in made)
    assert fast < found < 1.15e-3 and low < 1.15e-3


@longer
@pytest.mark.parametrize(
    ("name", "factor", "swing", "digit"),
    [
        ("temperature", 1.5, 0.0, 1e-11),
        ("natural", 1.2, 0.0080, 1e-4),
        ("existing", 1.2, 0.0070, 1e-4),
        ("friction_state", 1.5, 0.0, 1e-11),
        ("proposed", 1.5, 0.0, 1e-11),
        ("disturbance", 1.2, 0.0, 1e-11),
        ("extended_state", 1.2, 0.0, 1e-11),
        ("position_coulomb", 1.2, 0.16e-3, 1e-5),
        ("friedland_park", 1.2, 0.39e-3, 1e-5),
        ("position_lugre", 1.5, 0.0, 1e-10),
        ("normal_force", 1.2, 0.0, 1e-11),
        ("lyapunov", 1.2, 0.0, 1e-11),
        ("adaptive", 1.2, 0.0, 1e-11),
        ("general_coulomb", 1.2, 0.44e-3, 1e-5),
    ],
)
def test_limit_cycles_with_friction_overestimated(name, factor, swing, digit):
    assert cycle(name, factor) == pytest.approx(swing, abs=digit)


def by_period(blocks, periods):
    """RMS of theta - r in rad for each period of 0.1 sin 2 pi t."""
    t = np.arange(0.0, periods + STEP / 2, STEP)
    rows = sine(t)
    done = lg.simulate([lg.plant(P), *blocks], t, rows)
    e = (signals_by(done, "theta") - rows["r"])[: periods * 1000].reshape(periods, 1000)
    return np.sqrt(np.mean(e**2, axis=1))


@longer
def test_memory_learns_friction_that_no_law_describes():
    """1.2e-2 in period 5, 4.1e-3 in 10, 1.1e-3 in 20; without learning 70 mrad."""
    errors = by_period([lg.sliding_error(), lg.repetitive_memory(P)], 20)
    assert errors[[4, 9, 19]] == pytest.approx([1.2e-2, 4.1e-3, 1.1e-3], rel=0.05)
    none = by_period([lg.sliding_error(), lg.slotine_li(P)], 4)
    assert none[-1] == pytest.approx(0.070, rel=0.02)


@longer
def test_harmonics_that_are_left_out_remain_in_the_error():
    """At the end 1.7 mrad with 5 harmonics."""
    errors = by_period([lg.sliding_error(), lg.repetitive_control(P, harmonics=5)], 20)
    assert errors[-1] == pytest.approx(1.7e-3, rel=0.05)


# --- a torque that acts late ----

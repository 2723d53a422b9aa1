"""The checks of many designs against those of one, and the closed forms they use."""

import math
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from lugrectl.blocks.model import table1
from lugrectl.core.errors import InputError
from lugrectl.linear import (
    bandwidth_check,
    check_designs,
    l2_check,
    position_loop_tf,
    position_T,
    spr_check,
    velocity_loop_tf,
    velocity_T,
)

P = table1()
MADE = {"position": (position_T, position_loop_tf), "velocity": (velocity_T, velocity_loop_tf)}


def agrees(checks, loop, p, gains, K2, level="-3dB"):
    """Each design, one by one, by the exact checks."""
    of_error, of_reference = MADE[loop]
    for i in range(checks.stable.size):
        one = SimpleNamespace(**{k: v[i] for k, v in vars(p).items()})
        kp, ki, kd = (float(g[i]) for g in gains)
        gain = l2_check(one, K2[i])
        assert checks.l2_gain[i] == pytest.approx(gain.gain, rel=1e-15)
        assert checks.l2_frequency[i] == gain.frequency
        T = of_error(one, kp, ki, kd)
        bare = T.num[0][0], T.den[0][0]  # without the search for a repair
        assert checks.names[i] == spr_check(bare).classification, (kp, ki, kd)
        width = bandwidth_check(of_reference(one, kp, ki, kd), level)
        assert checks.bandwidth[i] == pytest.approx(width.bandwidth, rel=1e-9, nan_ok=True)
        if kp or ki:  # T = 0 has no poles left
            assert checks.stable[i] == width.stable, (kp, ki, kd)


@pytest.mark.parametrize(
    ("loop", "level"), [("position", "-3dB"), ("position", "half-power"), ("velocity", -6.0)]
)
def test_random_designs_agree_with_the_exact_checks(loop, level):
    rng = np.random.default_rng(7)
    n = 15

    def spread(low, high):
        return 10 ** rng.uniform(low, high, n)

    p = SimpleNamespace(J=spread(-4, -1), sigma0=spread(1, 4), sigma1=spread(-2, 1))
    signs = rng.choice([1, 1, 1, 1, 0, -1], (3, n))
    gains = [spread(-1, 3), spread(-2, 4), spread(-3, 1)] * signs
    if loop == "velocity":
        gains[2] = np.maximum(gains[2], -0.5 * p.J)
    K2 = rng.normal(0, 30, n)
    checks = check_designs(p, *gains, K2=K2, loop=loop, level=level)
    agrees(checks, loop, p, gains, K2, level)
    assert len(set(checks.classification)) > 2 and 0 < checks.stable.sum() < n


@pytest.mark.cases
@pytest.mark.parametrize("loop", ["position", "velocity"])
def test_designs_on_the_borders_agree(loop):
    """Binary fractions, so that equality holds: a = 0, b = 0, Kd Kp = J Ki, |K2|/sigma0 = ..."""
    values = np.array(list(product([0.0, 1.0], [-1, 0, 0.25, 1], [0, 0.25, 4], [0, 1, 2])))
    sigma1, kp, ki, kd = 0.5 * values[:, 0], *values[:, 1:].T
    full = np.ones_like(kp)
    p = SimpleNamespace(J=0.25 * full, sigma0=2 * full, sigma1=sigma1)
    checks = check_designs(p, kp, ki, kd, K2=full, loop=loop)
    agrees(checks, loop, p, (kp, ki, kd), full)
    seen = {"position": {"not PR", "PR", "WSPR", "SPR"}, "velocity": {"not PR", "PR", "SPR"}}
    assert set(checks.names) == seen[loop]


def test_borders_that_only_rounding_moves():
    """sigma1 Kd and sigma0 J that round alike but differ: the exact check's side is taken."""
    kd = 260 * 0.0022 / 0.6 * (1 + np.arange(-3, 4) * 2.0**-53)
    checks = check_designs(P, 15.0, 0.0, kd, K2=22.0, loop="position")
    for i, value in enumerate(kd):
        assert checks.names[i] == spr_check(position_T(P, kp=15, kd=value)).classification


def test_shapes_broadcast_over_chunks():
    kp, ki = np.linspace(1, 30, 150)[:, None], np.linspace(0, 30, 130)
    checks = check_designs(P, kp, ki, K2=22.0)
    assert checks.bandwidth.shape == (150, 130) and checks.spr[:, 0].all()
    assert not checks.spr[:, 1:].any() and checks.l2_gain[3, 4] == 22 / 260
    i, j = 149, 129
    assert checks.bandwidth[i, j] == pytest.approx(
        bandwidth_check(velocity_loop_tf(P, kp[i, 0], ki[j])).bandwidth, rel=1e-12
    )
    single = check_designs(P, 1.6, 0.16, K2=22.0)
    assert single.bandwidth.shape == () and single.names == "PR"
    assert check_designs(P, [], K2=22.0).stable.size == 0


@pytest.mark.parametrize(
    ("p", "options", "word"),
    [
        (P, {"loop": "torque"}, "torque"),
        (P, {"level": "3dB"}, "3dB"),
        (P, {"kp": [1, 2], "ki": [1, 2, 3]}, r"kp \(2,\), ki \(3,\)"),
        (P, {"kp": [1, math.nan]}, "kp"),
        (P, {"kp": "many"}, "kp"),
        (P, {"kd": [0.0, -1.0]}, "J \\+ kd"),
        (SimpleNamespace(J=0.0, sigma0=1.0, sigma1=1.0), {}, "J is not above 0"),
        (SimpleNamespace(J=1.0, sigma0=0.0, sigma1=1.0), {}, "sigma0"),
        (SimpleNamespace(J=1.0, sigma0=1.0, sigma1=-1.0), {}, "sigma1"),
        (SimpleNamespace(J=1.0, sigma0=1.0), {}, "sigma1"),
    ],
)
def test_designs_that_cannot_be_understood(p, options, word):
    with pytest.raises(InputError, match=word):
        check_designs(p, **{"K2": 1.0, **options})

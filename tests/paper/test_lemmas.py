"""The source paper's numbered equations: what holds, what holds corrected, what does not.

Symbols: s stands for |w|/h(w). Labels in the docstrings are those of the paper.
"""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import trapezoid

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY
from lugrectl.blocks.friction import level
from lugrectl.paper.equations import PAPER

from ..cases.error_systems import h
from ..cases.wired import joined

P = lg.table1()
J, s0, s1, s, A, C, al, be, M, C1 = sp.symbols("J s0 s1 s A C alpha beta M C1", positive=True)
B, K1, K2, K3, ez, ew, Fv, w, z, zh, wh, u = sp.symbols("B K1 K2 K3 ez ew Fv w z zh wh u")
DEZ = -s0 * s * ez - K1 * ew  # err_z_dot_new
DEW = -s0 / J * ez + s0 * s1 / J * s * ez - K3 * ew  # err_w_dot_new, second line
FULL = A * ez**2 + B * ez * ew + C * ew**2
BRACKET = C * s0 / (A * J) * (s1 * s - 1)
RANDOM = np.random.default_rng(3)
W, Z = (
    RANDOM.uniform(-1, 1, 50) * 10.0 ** RANDOM.uniform(-4, 1, 50),
    RANDOM.uniform(-1e-3, 1e-3, 50),
)


def same(left, right) -> bool:
    return sp.simplify(sp.expand(left - right)) == 0


def along(V, x=DEZ, y=DEW):
    """dV/dt along the error system."""
    return sp.diff(V, ez) * x + sp.diff(V, ew) * y


def rates(system, x, inputs):
    return np.asarray(system.dynamics(0.0, np.atleast_1d(x), np.atleast_1d(inputs)))


def outputs(system, x, inputs):
    y = system.output(0.0, np.atleast_1d(x), np.atleast_1d(inputs))
    return dict(zip(system.output_labels, y, strict=True))


def test_drive():
    """mechanical_sys1, LuGre1, LuGre2, Lugre3, Lugre_ss with the values of fric_params."""
    assert vars(P) == dict(J=0.0022, sigma0=260, sigma1=0.6, Fc=0.285, Fs=0.335, Fv=0.018, vs=0.01)
    plant = lg.plant(P)
    for speed, bristles in zip(W, Z, strict=True):
        _, dw, dz = rates(plant, [0.0, speed, bristles], [0.3, 0.0])
        F = outputs(plant, [0.0, speed, bristles], [0.3, 0.0])["F"]
        assert dz == pytest.approx(speed - 260 * abs(speed) / h(P, speed) * bristles, abs=1e-10)
        assert F == pytest.approx(260 * bristles + 0.6 * dz + 0.018 * speed, abs=1e-12)
        assert P.J * dw == pytest.approx(0.3 - F, abs=1e-12)
    steady, dz = REGISTRY["friction", "lugre"](W, h(P, W) * np.sign(W) / P.sigma0, **P.friction())
    assert dz == pytest.approx(0, abs=1e-12)
    assert steady == pytest.approx(h(P, W) * np.sign(W) + P.Fv * W)
    (static,) = REGISTRY["friction", "stribeck"](W, 0.285, 0.335, 0.018, 0.01, eps=1e-9)
    assert steady == pytest.approx(static)
    assert level(0.0, 0.285, 0.335, 0.01) == 0.335 and level(1.0, 0.285, 0.335, 0.01) == 0.285


def test_compensated_drive():
    """mechanical_sys2: u = Fhat + v leaves J dw/dt = v - (F - Fhat); sys1 where Fhat = F."""
    natural = lg.natural_observer(P)
    blocks = [lg.plant(P), natural, lg.compensation()]
    loop = joined(blocks, ["u"], ["w", "F", "Fhat"])
    for speed, bristles in zip(W, Z, strict=True):
        for miss in (0.0, 1e-4):
            state, v = [0.0, speed, bristles, bristles - miss], 0.2
            y = outputs(loop, state, [v])
            expected = v - (y["F"] - y["Fhat"])
            assert P.J * rates(loop, state, [v])[1] == pytest.approx(expected, abs=1e-12)
            assert miss or expected == pytest.approx(v, abs=1e-14)


def test_natural_observer():
    """z_hat_dot, F_est, and by subtraction err_z_dot."""
    made = lg.natural_observer(P)
    for speed, bristles in zip(W, Z, strict=True):
        (dz,) = rates(made, [bristles], [speed])
        slip = P.sigma0 * abs(speed) / h(P, speed)
        assert dz == pytest.approx(speed - slip * bristles, abs=1e-10)
        Fhat = outputs(made, [bristles], [speed])["Fhat"]
        assert Fhat == pytest.approx(P.sigma0 * bristles + P.sigma1 * dz + P.Fv * speed, abs=1e-12)
    assert same((w - s0 * s * z) - (w - s0 * s * zh), -s0 * s * (z - zh))


def test_F_err():
    """F_err: e_f = sigma0 e_z + sigma1 de_z/dt = sigma0 (1 - sigma1 |w|/h) e_z."""
    e_f = s0 * ez + s1 * (-s0 * s * ez)
    assert same(e_f, s0 * (1 - s1 * s) * ez)
    assert not same(e_f, s0 * (1 - s) * ez)  # as printed
    observer = lg.natural_observer(P)
    for speed, bristles in zip(W, Z, strict=True):
        F = REGISTRY["friction", "lugre"](speed, bristles, **P.friction())[0]
        miss = F - outputs(observer, [bristles - 2e-4], [speed])["Fhat"]
        slip = abs(speed) / h(P, speed)
        assert miss == pytest.approx(P.sigma0 * (1 - P.sigma1 * slip) * 2e-4, abs=1e-10)


def test_V_dot_and_proof1():
    """V_dot; proof1_eq, which needs C1 > 0; proof1_eq2 with |w| >= alpha and h <= C2."""
    C2, extra = sp.symbols("C2 extra", positive=True)
    V = ez**2 / 2
    dV = sp.diff(V, ez) * (-s0 * s * ez)
    assert same(dV, -s0 * s * ez**2)
    assert same(dV.subs(s, al / C2), -2 * s0 * al / C2 * V)
    assert sp.simplify((dV - dV.subs(s, s + extra)) / ez**2).is_positive  # decreasing in |w|/h
    for Fc, Fs in [(0.285, 0.335), (0.4, 0.3)]:
        found = level(np.linspace(-0.1, 0.1, 2001), Fc, Fs, 0.01)
        assert found.min() == pytest.approx(min(Fc, Fs)) and found.max() == max(Fc, Fs)
    assert level(1.0, 0.0, 0.3, 0.01) == 0.0  # C1 = 0: |w|/h has no bound at any speed


def test_proof2_eq2():
    """proof2_eq2: int |w|/h >= (1/C2) int |w|; the printed bound sigma0/C2 fails."""
    t = np.linspace(0, 1, 10001)
    speed = np.sin(2 * np.pi * t)
    travel, slip = trapezoid(abs(speed), t), trapezoid(abs(speed) / h(P, speed), t)
    assert slip >= travel / P.Fs
    assert not slip >= P.sigma0 / P.Fs * travel


def test_existing_observer():
    """Canudas_z and Canudas_u: zhat' = w - sigma0 |w|/h zhat - k e, u = -C e + Fhat + J ddr."""
    made = lg.existing_observer(P, k=0.7)
    for speed, bristles in zip(W, Z, strict=True):
        (dz,) = rates(made, [bristles], [speed, 0.3])
        slip = P.sigma0 * abs(speed) / h(P, speed)
        assert dz == pytest.approx(speed - slip * bristles - 0.7 * 0.3, abs=1e-10)
    loop = lg.position_loop(P, "existing", kp=15.0, ki=0.0, feedforward=True, k=0.7)
    t = np.linspace(0, 0.3, 301)
    y = lg.simulate(loop, t, [0.1 * np.sin(6 * t), -3.6 * np.sin(6 * t)])
    e, Fhat, torque = (y.outputs[loop.output_labels.index(k)] for k in ("e", "Fhat", "u"))
    assert torque == pytest.approx(-15.0 * e + Fhat + P.J * -3.6 * np.sin(6 * t), abs=1e-12)


def test_proposed_observer():
    """obs_1 and obs_2, with K1 in the torque estimate too."""
    made = lg.proposed_observer(P, K1=-10.24, K2=22.0)
    for speed, bristles in zip(W, Z, strict=True):
        miss = 0.05
        dz, dw = rates(made, [bristles, speed - miss], [speed, 0.4])
        slip = P.sigma0 * abs(speed) / h(P, speed)
        assert dz == pytest.approx(speed - slip * bristles - 10.24 * miss, abs=1e-10)
        right = -P.sigma0 * bristles - P.sigma1 * dz - P.Fv * speed + 0.4 + 22.0 * miss
        assert P.J * dw == pytest.approx(right, abs=1e-10)


def test_error_system():
    """err_z_dot_new and err_w_dot_new from drive and observer; u and Fv cancel."""
    dz, dzh = w - s0 * s * z, w - s0 * s * zh + K1 * (w - wh)
    dw = (u - s0 * z - s1 * dz - Fv * w) / J
    dwh = (-s0 * zh - s1 * dzh - Fv * w + u + K2 * (w - wh)) / J
    errors = {ez: z - zh, ew: w - wh}
    assert same(dz - dzh, DEZ.subs(errors))
    first = -s0 / J * ez - s1 / J * DEZ - K2 / J * ew
    assert same(dw - dwh, first.subs(errors))
    assert same(first, DEW.subs(K3, (K2 - s1 * K1) / J))


def test_V_dot_new_and_K1():
    """V_dot_new as printed; K1 makes its cross term vanish; K2 = alpha + sigma1 K1."""
    cross = 2 * C * s0 * s1 / J * s - 2 * C * s0 / J - 2 * A * K1
    V = A * ez**2 + C * ew**2
    printed = -2 * A * s0 * s * ez**2 - 2 * C * K3 * ew**2 + cross * ez * ew
    assert same(along(V), printed)
    assert same(cross.subs(K1, BRACKET), 0)
    assert not same(cross.subs(K1, C * s0 / (A * J) * (s - 1)), 0)  # sigma1 dropped, as in eq1
    assert same(((al + s1 * K1) - s1 * K1) / J, al / J)


def test_eq1_and_eq2():
    """eq1, eq2 with sigma1 in the bracket; K2 > 0 does not follow, J K3 >= alpha does."""
    assert same(s1 * BRACKET.subs(s, M / C1), s1 * C * s0 / (A * J) * (s1 * M / C1 - 1))
    printed = s1 * C * s0 / (A * J) * (s - 1)
    assert not same(s1 * BRACKET, printed)
    assert sp.diff(s1 * BRACKET, s).is_positive  # so the largest |w|/h gives the bound
    top = s1 * BRACKET.subs(s, M / C1)
    slack = sp.factor((al + top) - s1 * BRACKET - al)  # J K3 - alpha
    assert same(slack, s1**2 * C * s0 / (A * J) * (M / C1 - s))
    values = {A: 1, C: 1, J: 1, s0: 1, s1: 2, M: 1, C1: 1, al: sp.Rational(1, 10)}
    wrong = (al + printed.subs(s, M / C1)).subs(values)  # K2 as printed
    assert wrong - (s1 * BRACKET).subs(s, M / C1).subs(values) < values[al]  # J K3 < alpha
    values |= {s1: sp.Rational(1, 2), M: sp.Rational(1, 10)}
    assert (al + top).subs(values) < 0  # K2 < 0 with alpha > 0


def test_err_z_lap():
    """err_z_lap holds with the initial conditions e_z(0), e_w(0); without them it does not."""
    q, Ez, Ew, ez0, ew0 = sp.symbols("q Ez Ew ez0 ew0")
    # err_w_dot_new, first line, is J ew' + K2 ew = -(s0 ez + s1 ez'), whatever w does
    assert same((J * DEW + K2 * ew + s0 * ez + s1 * DEZ).subs(K3, (K2 - s1 * K1) / J), 0)
    law = J * (q * Ew - ew0) + K2 * Ew + s0 * Ez + s1 * (q * Ez - ez0)
    (found,) = sp.solve(law, Ez)
    kept = (-(J * q + K2) * Ew + s1 * ez0 + J * ew0) / (s1 * q + s0)
    assert same(found, kept)
    printed = -(J * q + K2) / (s1 * q + s0) * Ew
    assert not same(found, printed) and same(found.subs({ez0: 0, ew0: 0}), printed)
    assert sp.solve(sp.denom(printed), q) == [-s0 / s1]  # the pole, whatever K2 is


def test_new_V_dot():
    """new_V_dot as printed."""
    printed = (
        -s0 * (2 * A - B * s1 / J) * s * ez**2
        - B * s0 / J * ez**2
        - (B * K1 + 2 * C * K3) * ew**2
        + s0 * (2 * C * s1 / J - B) * s * ez * ew
        - (B * K3 + 2 * C * s0 / J + 2 * A * K1) * ez * ew
    )
    assert same(along(FULL), printed)


SOLUTION = {
    B: 2 * C * s1 / J,
    A: C * s1**2 / J**2 + be / 2,
    K1: -2 * C * (s1 * al + s0) / (be * J),
    K3: 2 * C * s1 * (s1 * al + s0) / (be * J**2) + al,
}


def test_ineq4():
    """ineq4: the cross term that must vanish is B K3 + 2 C sigma0/J + 2 A K1."""
    cross = sp.diff(along(FULL), ez, ew).subs(s, 0)
    right, printed = (B * K3 + 2 * C * s0 / J + 2 * A * K1 * factor for factor in (1, B))
    assert same(cross, -right) and not same(cross, -printed)
    assert same(right.subs(SOLUTION), 0) and not same(printed.subs(SOLUTION), 0)


def test_step_by_step_solution():
    """AB and K3_new satisfy ineq1, ineq2, ineq3 and eq_1; dV/dt is that of lemma6."""
    assert same((2 * A - B * s1 / J).subs(SOLUTION), be)  # ineq1
    assert SOLUTION[B].is_positive
    assert same((B * K1 + 2 * C * K3).subs(SOLUTION), 2 * C * al)  # ineq2
    assert same((2 * C * s1 / J - B).subs(SOLUTION), 0)  # ineq3
    assert same((B**2 - 4 * A * C).subs(SOLUTION), -2 * be * C)  # eq_1
    assert same((B * s1 / (2 * J) + be / 2).subs(SOLUTION), SOLUTION[A])  # AB
    assert same((J * K3 + s1 * K1).subs(SOLUTION), J * al)  # K3_new: K2 = J alpha
    dV = along(FULL).subs(SOLUTION)
    B_ = SOLUTION[B]
    assert same(dV, -s0 * be * s * ez**2 - B_ * s0 / J * ez**2 - 2 * C * al * ew**2)


def test_every_label_has_a_test_that_names_it():
    labels = [entry.label for entry in PAPER]
    assert len(set(labels)) == len(labels) == 47
    assert {entry.status for entry in PAPER} <= {"holds", "holds corrected", "does not hold"}
    sources = {}
    for entry in PAPER:
        file, _, name = entry.test.partition("::")
        if file not in sources:
            text = (Path(__file__).parent / file).read_text()
            nodes = [n for n in ast.parse(text).body if isinstance(n, ast.FunctionDef)]
            sources[file] = {n.name: f"{n.name} {ast.get_docstring(n)}" for n in nodes}
        words = re.findall(r"\w+", sources[file][name])
        assert entry.label in words or name == f"test_{entry.label}", entry

"""Every numbered equation, lemma and remark of the source paper, and whether it holds.

Source: Odabas and Morgul, "A Novel Observer Design for LuGre Friction Estimation and Control".
Labels are those of its text.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

HOLDS, CORRECTED, FAILS = "holds", "holds corrected", "does not hold"


class Label(NamedTuple):
    """A label of the paper, the test that names it, a note, and its status."""

    label: str
    test: str
    note: str = ""
    status: str = HOLDS


def _by(file: str, status: str, label: str, test: str, note: str = "") -> Label:
    return Label(label, f"{file}.py::test_{test}", note, status)


_of, _run = (partial(_by, file, HOLDS) for file in ("test_lemmas", "test_lemma_runs"))
_put, _ran = (partial(_by, file, CORRECTED) for file in ("test_lemmas", "test_lemma_runs"))

PAPER: tuple[Label, ...] = (
    _of("mechanical_sys1", "drive", "the plant; here with a load torque d in addition to F"),
    _of("sys1", "compensated_drive", "the drive if Fhat = F"),
    _of("mechanical_sys2", "compensated_drive"),
    _of("LuGre1", "drive"),
    _of("LuGre2", "drive"),
    _of("Lugre3", "drive", "the Stribeck velocity w_s is v_s in the paper's table and vs here"),
    _of("Lugre_ss", "drive", "the torque at constant speed"),
    _of("z_hat_dot", "natural_observer"),
    _of("F_est", "natural_observer"),
    _of("err_z_dot", "natural_observer", "for equal parameters in drive and observer"),
    _put("F_err", "F_err", "e_f = sigma0 (1 - sigma1 |w|/h) e_z; sigma1 is missing in print"),
    _of("V_dot", "V_dot_and_proof1"),
    _put("proof1_eq", "V_dot_and_proof1", "C1 = min(Fs, Fc) must be > 0, not >= 0"),
    _of("proof1_eq2", "V_dot_and_proof1"),
    _run("lemma1", "lemma1", "rate sigma0 alpha/C2 in e_z"),
    _run("lemma2_eq", "lemma2", "excitation(w, t) finds T and beta"),
    _run("lemma2", "lemma2", "with proof2_eq2 corrected: rate sigma0 beta/(C2 T)"),
    _run("proof2_eq", "proof2_eq", "natural_decay(p, w, t)"),
    _put(
        "proof2_eq2",
        "proof2_eq2",
        "int |w|/h >= (1/C2) int |w|; in print with a sigma0 that is missing on the left",
    ),
    _run("remark1", "remark1", "T = 1/(2f), beta = 1/(pi f)"),
    _run("remark2", "remark2", "for w in L1, e_z keeps at least exp(-sigma0/C1 int |w|)"),
    _run("lemma3", "lemma3", "e_f/e_z is bounded for bounded w"),
    _run("remark3", "remark3", "the error acts as a decaying disturbance"),
    _of(
        "Canudas_z",
        "existing_observer",
        "k has no unit on a velocity error and is in 1/s on a position error",
    ),
    _of(
        "Canudas_u",
        "existing_observer",
        "its T(s) must be SPR, which no pure integral action and no C with a finite C(inf) "
        "gives; tau in C(s) is a time constant, not a cut-off frequency",
    ),
    _of("obs_1", "proposed_observer", "K1 < 0 at rest"),
    _of("obs_2", "proposed_observer", "Fhat contains the K1 term of dzhat/dt"),
    _of("err_z_dot_new", "error_system"),
    _of("err_w_dot_new", "error_system", "both lines; u cancels"),
    _of("V_dot_new", "V_dot_new_and_K1"),
    _of("K1", "V_dot_new_and_K1", "alpha in N m s/rad here"),
    _ran("lemma4", "lemma4", "(i) holds; (ii) under lemma2 by this V needs w bounded as well"),
    _put(
        "eq1",
        "eq1_and_eq2",
        "sigma1 K1 <= sigma1 C sigma0/(A J) (sigma1 M/C1 - 1); sigma1 is missing in the bracket",
    ),
    _put(
        "eq2",
        "eq1_and_eq2",
        "K2 = alpha + sigma1 C sigma0/(A J) (sigma1 M/C1 - 1) gives J K3 >= alpha; K2 > 0 does "
        "not follow from alpha > 0 and is not needed",
    ),
    _ran(
        "lemma5",
        "lemma5",
        "with eq2 corrected, initial conditions kept in err_z_lap, sigma1 > 0 and M known "
        "beforehand; the lemma gives no rate",
    ),
    _put(
        "err_z_lap",
        "err_z_lap",
        "(sigma1 s + sigma0) E_z = -(J s + K2) E_w + sigma1 e_z(0) + J e_w(0); the initial "
        "conditions are missing in print; the pole is -sigma0/sigma1 for every K2",
    ),
    _ran(
        "remark4",
        "remark4",
        "K2 > 0 is not needed; independent of u only once M is known to bound |w|",
    ),
    _of("new_V_dot", "new_V_dot"),
    _of("ineq1", "step_by_step_solution"),
    _of("ineq2", "step_by_step_solution"),
    _of(
        "ineq3",
        "step_by_step_solution",
        "and cannot be avoided: any V that is valid for every |w|/h satisfies it",
    ),
    _put(
        "ineq4",
        "ineq4",
        "B K3 + 2 C sigma0/J + 2 A K1 = 0; the printed factor B in the last term is wrong",
    ),
    _of("AB", "step_by_step_solution", "with sigma1 > 0"),
    _of("K3_new", "step_by_step_solution", "alpha in 1/s here, K2 = J alpha"),
    _of("eq_1", "step_by_step_solution", "B^2 - 4 A C = -2 beta C"),
    _run("lemma6", "lemma6", "with sigma1 > 0; every K1 < 0 < K2 is sufficient, see certify"),
    _of("fric_params", "drive", "table1()"),
)

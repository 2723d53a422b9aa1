"""Every numbered equation, lemma and remark of the source paper, and whether it holds.

Source: Odabas and Morgul, "A Novel Observer Design for LuGre Friction Estimation and Control".
Labels are those of its text.
"""

from __future__ import annotations

from typing import NamedTuple

HOLDS, CORRECTED, FAILS = "holds", "holds corrected", "does not hold"


class Label(NamedTuple):
    """A label of the paper, the test that names it, a note, and its status."""

    label: str
    test: str
    note: str = ""
    status: str = HOLDS


_OF, _RUN = "test_lemmas.py::test_", "test_lemma_runs.py::test_"


def _corrected(label: str, test: str, note: str) -> Label:
    return Label(label, test, note, CORRECTED)


PAPER: tuple[Label, ...] = (
    Label(
        "mechanical_sys1", _OF + "drive", "the plant; here with a load torque d in addition to F"
    ),
    Label("sys1", _OF + "compensated_drive", "the drive if Fhat = F"),
    Label("mechanical_sys2", _OF + "compensated_drive"),
    Label("LuGre1", _OF + "drive"),
    Label("LuGre2", _OF + "drive"),
    Label(
        "Lugre3", _OF + "drive", "the Stribeck velocity w_s is v_s in the paper's table and vs here"
    ),
    Label("Lugre_ss", _OF + "drive", "the torque at constant speed"),
    Label("z_hat_dot", _OF + "natural_observer"),
    Label("F_est", _OF + "natural_observer"),
    Label("err_z_dot", _OF + "natural_observer", "for equal parameters in drive and observer"),
    _corrected(
        "F_err", _OF + "F_err", "e_f = sigma0 (1 - sigma1 |w|/h) e_z; sigma1 is missing in print"
    ),
    Label("V_dot", _OF + "V_dot_and_proof1"),
    _corrected("proof1_eq", _OF + "V_dot_and_proof1", "C1 = min(Fs, Fc) must be > 0, not >= 0"),
    Label("proof1_eq2", _OF + "V_dot_and_proof1"),
    Label("lemma1", _RUN + "lemma1", "rate sigma0 alpha/C2 in e_z"),
    Label("lemma2_eq", _RUN + "lemma2", "excitation(w, t) finds T and beta"),
    Label("lemma2", _RUN + "lemma2", "with proof2_eq2 corrected: rate sigma0 beta/(C2 T)"),
    Label("proof2_eq", _RUN + "proof2_eq", "natural_decay(p, w, t)"),
    _corrected(
        "proof2_eq2",
        _OF + "proof2_eq2",
        "int |w|/h >= (1/C2) int |w|; in print with a sigma0 that is missing on the left",
    ),
    Label("remark1", _RUN + "remark1", "T = 1/(2f), beta = 1/(pi f)"),
    Label("remark2", _RUN + "remark2", "for w in L1, e_z keeps at least exp(-sigma0/C1 int |w|)"),
    Label("lemma3", _RUN + "lemma3", "e_f/e_z is bounded for bounded w"),
    Label("remark3", _RUN + "remark3", "the error acts as a decaying disturbance"),
    Label(
        "Canudas_z",
        _OF + "existing_observer",
        "k has no unit on a velocity error and is in 1/s on a position error",
    ),
    Label(
        "Canudas_u",
        _OF + "existing_observer",
        "its T(s) must be SPR, which no pure integral action and no C with a finite C(inf) "
        "gives; tau in C(s) is a time constant, not a cut-off frequency",
    ),
    Label("obs_1", _OF + "proposed_observer", "K1 < 0 at rest"),
    Label("obs_2", _OF + "proposed_observer", "Fhat contains the K1 term of dzhat/dt"),
    Label("err_z_dot_new", _OF + "error_system"),
    Label("err_w_dot_new", _OF + "error_system", "both lines; u cancels"),
    Label("V_dot_new", _OF + "V_dot_new_and_K1"),
    Label("K1", _OF + "V_dot_new_and_K1", "alpha in N m s/rad here"),
    _corrected(
        "lemma4", _RUN + "lemma4", "(i) holds; (ii) under lemma2 by this V needs w bounded as well"
    ),
    _corrected(
        "eq1",
        _OF + "eq1_and_eq2",
        "sigma1 K1 <= sigma1 C sigma0/(A J) (sigma1 M/C1 - 1); sigma1 is missing in the bracket",
    ),
    _corrected(
        "eq2",
        _OF + "eq1_and_eq2",
        "K2 = alpha + sigma1 C sigma0/(A J) (sigma1 M/C1 - 1) gives J K3 >= alpha; K2 > 0 does "
        "not follow from alpha > 0 and is not needed",
    ),
    _corrected(
        "lemma5",
        _RUN + "lemma5",
        "with eq2 corrected, initial conditions kept in err_z_lap, sigma1 > 0 and M known "
        "beforehand; the lemma gives no rate",
    ),
    _corrected(
        "err_z_lap",
        _OF + "err_z_lap",
        "(sigma1 s + sigma0) E_z = -(J s + K2) E_w + sigma1 e_z(0) + J e_w(0); the initial "
        "conditions are missing in print; the pole is -sigma0/sigma1 for every K2",
    ),
    _corrected(
        "remark4",
        _RUN + "remark4",
        "K2 > 0 is not needed; independent of u only once M is known to bound |w|",
    ),
    Label("new_V_dot", _OF + "new_V_dot"),
    Label("ineq1", _OF + "step_by_step_solution"),
    Label("ineq2", _OF + "step_by_step_solution"),
    Label(
        "ineq3",
        _OF + "step_by_step_solution",
        "and cannot be avoided: any V that is valid for every |w|/h satisfies it",
    ),
    _corrected(
        "ineq4",
        _OF + "ineq4",
        "B K3 + 2 C sigma0/J + 2 A K1 = 0; the printed factor B in the last term is wrong",
    ),
    Label("AB", _OF + "step_by_step_solution", "with sigma1 > 0"),
    Label("K3_new", _OF + "step_by_step_solution", "alpha in 1/s here, K2 = J alpha"),
    Label("eq_1", _OF + "step_by_step_solution", "B^2 - 4 A C = -2 beta C"),
    Label(
        "lemma6", _RUN + "lemma6", "with sigma1 > 0; every K1 < 0 < K2 is sufficient, see certify"
    ),
    Label("fric_params", _OF + "drive", "table1()"),
)

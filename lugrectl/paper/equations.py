"""Every numbered equation, lemma and remark of the source paper, and whether it holds.

Source: Odabas and Morgul, "A Novel Observer Design for LuGre Friction Estimation and Control".
Labels are those of its text.
"""

from __future__ import annotations

from typing import NamedTuple

HOLDS, CORRECTED, FAILS = "holds", "holds corrected", "does not hold"


class Label(NamedTuple):
    """A label of the paper, its status, a note, and the test that names it."""

    label: str
    status: str
    note: str
    test: str


_EQUATIONS = "test_lemmas.py::"
_RUNS = "test_lemma_runs.py::"

PAPER: tuple[Label, ...] = (
    Label(
        "mechanical_sys1",
        HOLDS,
        "the plant; here with a load torque d in addition to F",
        _EQUATIONS + "test_drive",
    ),
    Label("sys1", HOLDS, "the drive if Fhat = F", _EQUATIONS + "test_compensated_drive"),
    Label("mechanical_sys2", HOLDS, "", _EQUATIONS + "test_compensated_drive"),
    Label("LuGre1", HOLDS, "", _EQUATIONS + "test_drive"),
    Label("LuGre2", HOLDS, "", _EQUATIONS + "test_drive"),
    Label(
        "Lugre3",
        HOLDS,
        "the Stribeck velocity w_s is v_s in the paper's table and vs here",
        _EQUATIONS + "test_drive",
    ),
    Label("Lugre_ss", HOLDS, "the torque at constant speed", _EQUATIONS + "test_drive"),
    Label("z_hat_dot", HOLDS, "", _EQUATIONS + "test_natural_observer"),
    Label("F_est", HOLDS, "", _EQUATIONS + "test_natural_observer"),
    Label(
        "err_z_dot",
        HOLDS,
        "for equal parameters in drive and observer",
        _EQUATIONS + "test_natural_observer",
    ),
    Label(
        "F_err",
        CORRECTED,
        "e_f = sigma0 (1 - sigma1 |w|/h) e_z; sigma1 is missing in print",
        _EQUATIONS + "test_F_err",
    ),
    Label("V_dot", HOLDS, "", _EQUATIONS + "test_V_dot_and_proof1"),
    Label(
        "proof1_eq",
        CORRECTED,
        "C1 = min(Fs, Fc) must be > 0, not >= 0",
        _EQUATIONS + "test_V_dot_and_proof1",
    ),
    Label("proof1_eq2", HOLDS, "", _EQUATIONS + "test_V_dot_and_proof1"),
    Label("lemma1", HOLDS, "rate sigma0 alpha/C2 in e_z", _RUNS + "test_lemma1"),
    Label("lemma2_eq", HOLDS, "excitation(w, t) finds T and beta", _RUNS + "test_lemma2"),
    Label(
        "lemma2", HOLDS, "with proof2_eq2 corrected: rate sigma0 beta/(C2 T)", _RUNS + "test_lemma2"
    ),
    Label("proof2_eq", HOLDS, "natural_decay(p, w, t)", _RUNS + "test_proof2_eq"),
    Label(
        "proof2_eq2",
        CORRECTED,
        "int |w|/h >= (1/C2) int |w|; in print with a sigma0 that is missing on the left",
        _EQUATIONS + "test_proof2_eq2",
    ),
    Label("remark1", HOLDS, "T = 1/(2f), beta = 1/(pi f)", _RUNS + "test_remark1"),
    Label(
        "remark2",
        HOLDS,
        "for w in L1, e_z keeps at least exp(-sigma0/C1 int |w|)",
        _RUNS + "test_remark2",
    ),
    Label("lemma3", HOLDS, "e_f/e_z is bounded for bounded w", _RUNS + "test_lemma3"),
    Label("remark3", HOLDS, "the error acts as a decaying disturbance", _RUNS + "test_remark3"),
    Label(
        "Canudas_z",
        HOLDS,
        "k has no unit on a velocity error and is in 1/s on a position error",
        _EQUATIONS + "test_existing_observer",
    ),
    Label(
        "Canudas_u",
        HOLDS,
        "its T(s) must be SPR, which no pure integral action and no C with a finite C(inf) gives; "
        "tau in C(s) is a time constant, not a cut-off frequency",
        _EQUATIONS + "test_existing_observer",
    ),
    Label("obs_1", HOLDS, "K1 < 0 at rest", _EQUATIONS + "test_proposed_observer"),
    Label(
        "obs_2",
        HOLDS,
        "Fhat contains the K1 term of dzhat/dt",
        _EQUATIONS + "test_proposed_observer",
    ),
    Label("err_z_dot_new", HOLDS, "", _EQUATIONS + "test_error_system"),
    Label("err_w_dot_new", HOLDS, "both lines; u cancels", _EQUATIONS + "test_error_system"),
    Label("V_dot_new", HOLDS, "", _EQUATIONS + "test_V_dot_new_and_K1"),
    Label("K1", HOLDS, "alpha in N m s/rad here", _EQUATIONS + "test_V_dot_new_and_K1"),
    Label(
        "lemma4",
        CORRECTED,
        "(i) holds; (ii) under lemma2 by this V needs w bounded as well",
        _RUNS + "test_lemma4",
    ),
    Label(
        "eq1",
        CORRECTED,
        "sigma1 K1 <= sigma1 C sigma0/(A J) (sigma1 M/C1 - 1); sigma1 is missing in the bracket",
        _EQUATIONS + "test_eq1_and_eq2",
    ),
    Label(
        "eq2",
        CORRECTED,
        "K2 = alpha + sigma1 C sigma0/(A J) (sigma1 M/C1 - 1) gives J K3 >= alpha; K2 > 0 does not "
        "follow from alpha > 0 and is not needed",
        _EQUATIONS + "test_eq1_and_eq2",
    ),
    Label(
        "lemma5",
        CORRECTED,
        "with eq2 corrected, initial conditions kept in err_z_lap, sigma1 > 0 and M known "
        "beforehand; the lemma gives no rate",
        _RUNS + "test_lemma5",
    ),
    Label(
        "err_z_lap",
        CORRECTED,
        "(sigma1 s + sigma0) E_z = -(J s + K2) E_w + sigma1 e_z(0) + J e_w(0); the initial "
        "conditions are missing in print; the pole is -sigma0/sigma1 for every K2",
        _EQUATIONS + "test_err_z_lap",
    ),
    Label(
        "remark4",
        CORRECTED,
        "K2 > 0 is not needed; independent of u only once M is known to bound |w|",
        _RUNS + "test_remark4",
    ),
    Label("new_V_dot", HOLDS, "", _EQUATIONS + "test_new_V_dot"),
    Label("ineq1", HOLDS, "", _EQUATIONS + "test_step_by_step_solution"),
    Label("ineq2", HOLDS, "", _EQUATIONS + "test_step_by_step_solution"),
    Label(
        "ineq3",
        HOLDS,
        "and cannot be avoided: any V that is valid for every |w|/h satisfies it",
        _EQUATIONS + "test_step_by_step_solution",
    ),
    Label(
        "ineq4",
        CORRECTED,
        "B K3 + 2 C sigma0/J + 2 A K1 = 0; the printed factor B in the last term is wrong",
        _EQUATIONS + "test_ineq4",
    ),
    Label("AB", HOLDS, "with sigma1 > 0", _EQUATIONS + "test_step_by_step_solution"),
    Label(
        "K3_new",
        HOLDS,
        "alpha in 1/s here, K2 = J alpha",
        _EQUATIONS + "test_step_by_step_solution",
    ),
    Label("eq_1", HOLDS, "B^2 - 4 A C = -2 beta C", _EQUATIONS + "test_step_by_step_solution"),
    Label(
        "lemma6",
        HOLDS,
        "with sigma1 > 0; every K1 < 0 < K2 is sufficient, see certify",
        _RUNS + "test_lemma6",
    ),
    Label("fric_params", HOLDS, "table1()", _EQUATIONS + "test_drive"),
)

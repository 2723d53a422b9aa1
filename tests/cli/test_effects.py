"""lugrectl effects, and what lugrectl says of itself."""

import json
import subprocess
import sys

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import members

from ..cases import small_answers
from ..cases.quick_work import typed as run


def test_effects_lists_the_whole_catalogue(capsys):
    code, out, _ = run(capsys, "effects --json")
    listed = json.loads(out)
    assert code == 0 and [e["name"] for e in listed] == list(members("effect"))
    units = {k: p["unit"] for k, p in listed[2]["parameters"].items()}
    assert units == {"amplitude": "N m", "harmonic": "1/rev", "phase": "rad"}
    code, out, _ = run(capsys, "effects")
    assert code == 0 and max(map(len, out.splitlines())) <= 80
    for effect in listed:
        assert effect["name"] in out and effect["equation"] in out
        assert all(name in out for name in effect["confused_with"])
        code, own, _ = run(capsys, f"effects {effect['name']}")
        assert code == 0 and own.startswith(effect["name"])
        assert max(map(len, own.splitlines())) <= 80


def test_one_effect_is_explained(capsys):
    code, out, err = run(capsys, "effects torque_ripple")
    said = " ".join(out.split())
    assert code == 0 and err == "" and "amplitude: N m, at least 0, no effect at 0" in said
    assert "confused with: periodic_disturbance" in said and "also called: cogging" in said
    code, out, _ = run(capsys, "effects windage --json")
    assert code == 0 and json.loads(out)["name"] == "quadratic_drag"
    code, out, err = run(capsys, "effects windag")
    assert code == 2 and out == "" and len(err.splitlines()) == 1
    assert "did you mean 'windage'?" in err


def alone(line, heavy):
    """What a command prints in a process of its own, which does not load these modules."""
    code = (
        f"import sys, lugrectl.cli as c; code = c.main({line.split()!r}); "
        f"heavy = {{{heavy}}} & set(sys.modules); "
        "sys.exit(f'{code} {heavy}' if code or heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout, done.stderr
    return done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("line", ["--version", "effects", "effects play --json", "model", ""])
def test_what_needs_no_record_loads_nothing_heavy(line):
    alone(line, "'control', 'scipy', 'matplotlib', 'numba', 'lugrectl.diagnosis.diagnose', "
          "'lugrectl.report'")  # fmt: skip


def test_a_record_is_diagnosed_without_loading_python_control_or_matplotlib(tmp_path):
    log = small_answers.log(load=small_answers.ripple)
    np.savetxt(
        tmp_path / "a.csv", np.c_[*log.values()], "%.9g", ",", header=",".join(log), comments=""
    )
    lg.write_model(small_answers.DRIVE, tmp_path / "m.toml")
    line = f"diagnose {tmp_path}/a.csv --model {tmp_path}/m.toml"
    assert "found" in alone(line, "'control', 'matplotlib', 'numba'")


# --- help --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["compare", "plan", "export"])
def test_a_command_that_is_not_built_says_so(capsys, name):
    code, out, err = run(capsys, f"{name} run.csv")
    assert (code, out) == (2, "") and f"error: {name} is not built yet" in err
    assert f"  {name} " not in run(capsys, "--help")[1]


def test_an_error_in_one_s_own_block_names_file_and_line(tmp_path, capsys):
    own, log, model = (tmp_path / name for name in ("own.py", "run.csv", "m.toml"))
    own.write_text(
        "import lugrectl as lg\n\n\n"
        '@lg.block("effect", out="d", acts="torque")\n'
        'def misspelt_drag(w, c=lg.P(0, "N m", 0, neutral=0)):\n'
        "    return c * ww\n"
    )
    rows = [f"{0.01 * k},{0.3 if k % 80 < 40 else -0.3},{0.1 * (k % 80)}" for k in range(400)]
    log.write_text("\n".join(["t,u,w", *rows]))
    model.write_text("[plant]\nJ = 0.002\n[friction]\nmodel = 'coulomb'\nFc = 0.1\n")
    code, _, err = run(capsys, f"diagnose {log} --model {model} --blocks {own}")
    assert code == 2 and f"{own}, line 6: NameError" in err

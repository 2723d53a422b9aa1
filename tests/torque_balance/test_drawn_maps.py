"""Runs at steady speed as one friction map, drawn by plain formulas and as measured."""

import json

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.model import model_from_dict
from lugrectl.cli import main
from tests.drives.steady import EFFECTS, friction_map


def case(name, seed, swing=False):
    made = friction_map(name, seed, swing=swing)
    return made, lg.diagnose(made.runs, model_from_dict(made.model, "drawn"))


@pytest.mark.slow
@pytest.mark.cases
@pytest.mark.parametrize("name", EFFECTS[::-1])
def test_what_hangs_on_speed_is_named(name):
    made, found = case(name, 20)
    assert found.verdict in ("found", "ambiguous")
    assert [e.name for e in found.effects] == [name]
    assert found.error["augmented"] < 0.5 * found.error["refitted"]
    for key, estimate in found.effects[0].parameters.items():
        if estimate.ci95 is not None and key in made.values:
            middle, half = np.mean(estimate.ci95), 0.5 * np.ptp(estimate.ci95)
            assert abs(made.values[key] - middle) < 2.5 * half


def test_a_swing_with_the_angle_is_told_with_its_size():
    made, found = case("none", 31, swing=True)
    assert found.verdict == "ambiguous" and found.depends_on == ("theta",)
    assert "theta" in found.experiment and found.effects[0].alternatives
    assert "phase" not in found.effects[0].parameters
    assert not found.model.effects  # its phase is not known
    order, size = found.map.swing[0]
    assert size.ci95[0] < made.swing < size.ci95[1]
    assert (found.effects[0].name == "gravity") == (order == 1)


@pytest.mark.slow
def test_files_of_many_rates_from_the_command_line(tmp_path, capsys):
    made = friction_map("constant_torque", 20, swing=False)
    for i, columns in enumerate(made.runs[::2]):
        table = np.column_stack(list(columns.values()))
        np.savetxt(tmp_path / f"{i}.csv", table, delimiter=",", header="t,w,u", comments="")
    (tmp_path / "m.toml").write_text('[friction]\nmodel = "stribeck"\n')
    files = [str(p) for p in sorted(tmp_path.glob("*.csv"))]
    out = tmp_path / "out"
    line = ["diagnose", *files, "--model", str(tmp_path / "m.toml"), "--json", "--out", str(out)]
    assert main(line) == 0
    assert json.loads(capsys.readouterr().out)["effects"][0]["name"] == "constant_torque"
    assert "Mean torque" in (out / "report.html").read_text()
    assert lg.read_model(out / "model.toml").effects[0].block.name == "constant_torque"


@pytest.mark.slow
def test_what_is_left_out_for_being_small_counts_in_intervals():
    """Friction steeper one way beside a constant torque of a hundredth, which is not named."""
    w = np.r_[-4.0:-0.4:6j, 0.4:4.0:6j]
    Fv, rng = np.where(w > 0, 0.56, 0.48), np.random.default_rng(3)
    runs = []
    for k, v in enumerate(w):
        t = 0.01 * np.arange(300)
        u = 0.572 * np.sign(v) + Fv[k] * v + 0.012 + 0.002 * rng.standard_normal(300)
        runs.append({"t": t, "u": u + 0.001 * rng.standard_normal(), "theta": v * t})
    found = lg.diagnose(runs, lg.Model.of(friction="coulomb"))
    (effect,) = found.effects
    assert effect.name == "viscous_asymmetry"
    assert effect.parameters["ratio"].may_be(0.08 / 1.04)
    assert found.plain.parameters["constant_torque"].may_be(0.012)

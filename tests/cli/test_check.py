"""``lugrectl check``: the paper's loops on either side of their conditions."""

import json

import pytest

from lugrectl.cli import main


def run(capsys, line):
    code = main(f"check {line}".split())
    out, err = capsys.readouterr()
    return code, out, err


def test_spr_on_the_two_sides_for_table_1(capsys):
    """sigma0 J / sigma1 = 0.95333."""
    code, out, _ = run(capsys, "spr --kp 15 --kd 0.953")
    assert code == 1 and out.startswith("not SPR") and "Kd above 0.953333" in out
    code, out, _ = run(capsys, "spr --kp 15 --kd 0.955")
    assert code == 0 and out.startswith("SPR") and "becomes SPR" not in out


def test_the_suggested_repair_works_when_typed(capsys):
    code, out, _ = run(capsys, "spr --json")
    sentence = json.loads(out)["repair"]
    assert code == 1 and "0.9534" in sentence and "0.01033" in sentence
    code, out, _ = run(capsys, "spr --kp 15 --ki 1.55 --kd 0.9534 --leak 0.01033 --json")
    assert code == 0 and json.loads(out)["repair"] is None


def test_unstable_position_loop_exits_1_with_its_poles(capsys):
    code, out, _ = run(capsys, "bandwidth --position --kp 15 --ki 1.55")
    assert code == 1 and "poles +0.05167 +- 82.57j, -0.1033" in out


def test_prefilter_and_half_power(capsys):
    def hertz(options):
        code, out, _ = run(capsys, f"bandwidth --json {options}")
        assert code == 0
        return json.loads(out)["hertz"]

    assert hertz("") == pytest.approx(115.5, abs=0.05)
    assert hertz("--half-power") == pytest.approx(115.8, abs=0.05)
    assert hertz("--prefilter --half-power") == pytest.approx(2 / 6.2832, rel=1e-2)
    _, out, _ = run(capsys, "bandwidth --prefilter")
    assert "prefilter 2/(s + 2)" in out.splitlines()[0]


def test_a_filtered_derivative_is_never_spr_on_position(capsys):
    code, out, _ = run(capsys, "spr --kp 15 --kd 2 --derivative-filter 0.001")
    assert code == 1 and "no filter on the derivative" in out
    assert run(capsys, "spr --velocity --kp 15 --kd 2 --derivative-filter 0.001")[0] == 0


def test_options_without_a_part_are_named(capsys):
    _, _, err = run(capsys, "spr --prefilter --half-power --K2 3")
    assert "--K2, --prefilter, --half-power" in err
    _, out, err = run(capsys, "l2 --leak 3 --derivative-filter 1")
    assert "--leak, --derivative-filter" in err and "e_z is in L2 if e_w is" in " ".join(
        out.split()
    )
    code, out, err = run(capsys, "spr --ki 1 --tau 1 --leak 1")
    assert code == 2 and not out and "tau and leak" in err

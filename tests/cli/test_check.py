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
    for line, expected in (("spr", 1), ("spr --velocity", 1), ("spr --velocity --kp 1.6", 0)):
        code, out, _ = run(capsys, f"{line} --json")
        found = json.loads(out)
        assert code == expected and found["holds"] == (code == 0)
        assert found["loop"] == ("velocity" if "--velocity" in line else "position")


def test_the_suggested_repair_works_when_typed(capsys):
    code, out, _ = run(capsys, "spr --json")
    sentence = json.loads(out)["repair"]
    assert code == 1 and "0.9534" in sentence and "0.01033" in sentence
    code, out, _ = run(capsys, "spr --kp 15 --ki 1.55 --kd 0.9534 --leak 0.01033 --json")
    assert code == 0 and json.loads(out)["repair"] is None


def test_unstable_position_loop_exits_1_with_its_poles(capsys):
    for gains in ("", " --kp 15 --ki 1.55"):
        code, out, _ = run(capsys, f"bandwidth --position{gains}")
        assert code == 1 and out.startswith("unstable loop")
        assert "poles +0.05167 +- 82.57j, -0.1033" in out


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


def test_a_transfer_function_is_checked_as_it_is_typed(capsys):
    code, out, _ = run(capsys, "spr --num 1,10 --den 1,2,0.5")
    assert code == 1 and out.startswith("not SPR: T(s) = (s + 10)/(s^2 + 2 s + 0.5)\n")
    code, out, _ = run(capsys, "l2 --num -1,2 --den 1,-0.5 --dt 0.01 --json")
    found = json.loads(out)
    assert code == 0 and found["gain"] == pytest.approx(2.0)
    assert found["transfer"] == {"num": [-1, 2], "den": [1, -0.5], "dt": 0.01}
    assert found["model"] is None and found["gains"] == {}
    code, out, _ = run(capsys, "bandwidth --num 1 --den 1,1 --half-power --json")
    assert code == 0 and json.loads(out)["bandwidth"] == pytest.approx(1.0)
    code, out, _ = run(capsys, "bandwidth --num 1 --den 1,0")
    assert code == 1 and out.startswith("no bandwidth: T(s) = (1)/(s)\n")
    assert "T(0) is infinite, so there is no DC gain" in " ".join(out.split())
    code, out, _ = run(capsys, "bandwidth --num=1 --den=1,-1")
    assert code == 1 and out.startswith("unstable T: T(s) = (1)/(s - 1)")


def test_decimals_of_a_typed_transfer_function_are_exact(capsys):
    """sigma1 Kd = sigma0 J holds for these decimals, for none of their floats."""
    _, out, _ = run(capsys, "spr --num 0.6,260 --den 0.0003,0.13,15 --json")
    assert json.loads(out)["classification"] == "WSPR"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("l2 --num 1 --den 1,x", "--den is '1,x', but numbers in descending powers"),
        ("l2 --num 1 --den 1e400", "--den is '1e400', but numbers"),
        ("l2 --num 1 --den 0", "--den is zero"),
        ("l2 --num 1", "--den is missing"),
        ("spr --den 1", "--num is missing"),
        ("spr --dt 0.1", "--dt is the sample time of T(z): give --num and --den too"),
        ("spr --num 1 --den 1 --dt -1", "-1 is not above 0"),
        ("spr --plot a.gif", "--plot a.gif: the picture must be a file .png"),
        ("spr --plot /no/such/folder/a.png", "--plot /no/such/folder/a.png: there is no folder"),
    ],
)
def test_a_transfer_function_that_cannot_be_understood_is_one_sentence(capsys, line, words):
    code, out, err = run(capsys, line)
    assert code == 2 and out == "" and words in err and err.count("\n") == 1


def test_options_that_a_typed_transfer_function_leaves_without_a_part_are_named(capsys):
    _, _, err = run(capsys, "bandwidth --num 1 --den 1,1 --position --kp 3 --half-power")
    assert "does not depend on --kp, --position: not used" in err and "half-power" not in err


@pytest.mark.parametrize(
    "what, T",
    [
        ("spr", ""),
        ("l2", "--num 1,10 --den 1,2,0.5"),
        ("bandwidth", "--num 1,10 --den 1,2,0.5"),
        ("spr", "--num 1,0.2 --den 1,-0.4 --dt 0.1"),
        ("bandwidth", "--num 1,0.2 --den 1,-0.4 --dt 0.1"),
    ],
)
def test_the_verdict_is_drawn_into_a_file(capsys, tmp_path, what, T):
    file = tmp_path / "check.png"
    code, out, err = run(capsys, f"{what} {T} --plot {file} --json")
    assert code in (0, 1) and json.loads(out)["check"] == what
    assert file.read_bytes()[:4] == b"\x89PNG" and f"picture: {file}" in err
    assert [*tmp_path.iterdir()] == [file]


def test_stability_needs_the_inertia_alone(capsys, tmp_path):
    file = tmp_path / "coulomb.toml"
    file.write_text('plant.J = 0.0022\n[friction]\nmodel = "coulomb"\n')
    table, _, _ = run(capsys, "stability")
    code, out, err = run(capsys, f"stability --model {file} --kp 1.6 --ki 0.16")
    assert code == table == 0 and "stable loop" in out and not err
    code, _, err = run(capsys, f"spr --model {file} --kp 1")
    assert code == 2 and "spr is about LuGre friction" in err


def test_stability_says_how_much_more_dead_time_the_loop_stands(capsys):
    code, out, _ = run(capsys, "stability --json")
    margin = json.loads(out)["delay_margin"]
    assert code == 0 and margin == pytest.approx(2.16e-3, rel=1e-2)
    for late, stable in ((0.99 * margin, True), (1.01 * margin, False)):
        code, out, _ = run(capsys, f"stability --dead-time {late}")
        assert (code == 0) == stable and out.startswith("stable" if stable else "unstable")
    code, out, _ = run(capsys, "stability --num 100 --den 1,0 --dead-time 0.01")
    assert code == 0 and "exp(-0.01 s)" in out and "delay_margin: 0.00570796 s" in out


def test_a_dead_time_is_in_the_loop_that_is_checked(capsys):
    def hertz(options):
        return json.loads(run(capsys, f"bandwidth --json {options}")[1])["hertz"]

    assert hertz("--dead-time 0.001") > 2 * hertz("--dead-time 0") == 2 * hertz("")
    assert run(capsys, "bandwidth --dead-time 0.0025")[0] == 1
    assert run(capsys, "spr --velocity --kp 1.6 --dead-time 0.001")[0] == 0
    code, out, _ = run(capsys, "spr --position --kp 15 --kd 1.2 --dead-time 0.001")
    assert code == 1 and "Re T(jw) < 0 first for 1102.06" in " ".join(out.split())
    assert "--dead-time" in run(capsys, "l2 --dead-time 0.01")[2]
    code, _, err = run(capsys, "bandwidth --dead-time -1")
    assert code == 2 and "dead_time is -1 s" in err


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("", "are required: property (l2, spr, bandwidth, stability, passivity)"),
        ("--kp 3", "are required: property (l2, spr, bandwidth, stability, passivity)"),
        (
            "foo",
            "no property 'foo' (choose from 'l2', 'spr', 'bandwidth', 'stability', 'passivity')",
        ),
        ("bandwith", "there is no property 'bandwith' (did you mean bandwidth?)"),
        ("SPR", "there is no property 'SPR' (did you mean spr?)"),
        ("l2 --k2 3", "unrecognized arguments: --k2 3 (did you mean --K2?)"),
    ],
)
def test_a_property_that_is_missing_or_wrong_is_named_with_those_there_are(capsys, line, said):
    code, out, err = run(capsys, line)
    assert code == 2 and not out and said in err and err.count("\n") == 1


def test_stability_gives_all_margins_of_a_sampled_loop(capsys):
    code, out, _ = run(capsys, "stability --num 0.5,0.4 --den 1,-1.2,0.2 --dt 0.01 --json")
    found = json.loads(out)
    for margin in ("gain_margin", "phase_margin", "modulus_margin", "delay_margin"):
        assert code == 0 and found[margin] > 0 and 0 < found[f"{margin}_frequency"] <= 315
    assert found["Ms"] == pytest.approx(1 / found["modulus_margin"])
    _, text, _ = run(capsys, "stability --num 0.5,0.4 --den 1,-1.2,0.2 --dt 0.01")
    assert f"gain_margin: {found['gain_margin']:.6g} (" in text and " dB, at " in text


def test_passivity_of_the_friction_says_which_values_would_do(capsys, tmp_path):
    code, out, err = run(capsys, "passivity --kp 3")
    assert code == 1 and out.startswith("friction that is not passive") and "--kp: not used" in err
    assert "largest_sigma1: 0.1026 N m s/rad" in out and "speed: 4.51246 rad/s" in out
    code, out, _ = run(capsys, "passivity --json")
    least = json.loads(out)["least_Fv"]
    file = tmp_path / "drive.toml"
    values = f"sigma0 = 260\nsigma1 = 0.6\nFc = 0.285\nFs = 0.335\nvs = 0.01\nFv = {least}"
    file.write_text(f'[plant]\nJ = 0.0022\n[friction]\nmodel = "lugre"\n{values}\n')
    assert run(capsys, f"passivity --model {file}")[0] == 0
    assert "--num: passivity is about" in run(capsys, "passivity --num 1 --den 1,2")[2]
    file.write_text('[plant]\nJ = 0.0022\n[friction]\nmodel = "coulomb"\nFc = 0.3\nFv = 0.01\n')
    code, _, err = run(capsys, f"passivity --model {file}")
    assert code == 2 and "passivity is about LuGre friction" in err

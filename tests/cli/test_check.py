"""``lugrectl check``: the paper's loops on either side of their conditions."""

import json
from functools import partial

import pytest

from lugrectl.blocks.model import Model, table1, write_model

from ..cases.quick_work import typed

run = partial(typed, command="check")


@pytest.fixture(autouse=True)
def files(tmp_path, monkeypatch):
    """Models as the working directory."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "coulomb.toml").write_text('plant.J = 0.0022\n[friction]\nmodel = "coulomb"\n')
    (tmp_path / "part.toml").write_text('[friction]\nmodel = "lugre"\nsigma0 = 260.0\n')
    write_model(Model.of(table1()).with_values({"sigma1": 0.0}), tmp_path / "stiff.toml")


def facts(capsys, line, code=0):
    """The JSON document of a check."""
    got, out, _ = run(capsys, f"{line} --json")
    found = json.loads(out)
    assert got == code and found["holds"] == (code == 0)
    return found


SAID = [  # the line, its exit code, how the answer begins, and more of it
    # sigma0 J / sigma1 = 0.95333 for Table 1
    ("spr --kp 15 --kd 0.953", 1, "not SPR: position loop of Table 1", "Kd above 0.953333"),
    ("spr --kp 15 --kd 0.955", 0, "SPR", ""),
    ("spr --velocity", 1, "not SPR", ""),
    ("spr --velocity --kp 1.6", 0, "SPR", ""),
    ("spr --kp 15 --kd 2 --derivative-filter 0.001", 1, "not SPR", "no filter on the derivative"),
    ("spr --velocity --kp 15 --kd 2 --derivative-filter 0.001", 0, "SPR", ""),
    ("spr --velocity --kp 1.6 --dead-time 0.001", 0, "SPR", ""),
    ("spr --position --kp 15 --kd 1.2 --dead-time 0.001", 1, "not SPR",
     "Re T(jw) < 0 first for 1102.06"),
    ("bandwidth --position", 1, "unstable loop", "poles +0.05167 +- 82.57j, -0.1033"),
    ("bandwidth --position --kp 15 --ki 1.55", 1, "unstable loop", "+0.05167 +- 82.57j, -0.1033"),
    ("bandwidth --prefilter", 0, "bandwidth", "prefilter 2/(s + 2)"),
    ("bandwidth --dead-time 0.0025", 1, "unstable loop", ""),
    ("bandwidth --model coulomb.toml", 0, "bandwidth", ""),
    ("l2", 0, "finite L2 gain: Table 1", "e_z is in L2 if e_w is"),
    ("l2 --model stiff.toml", 1, "no finite L2 gain", "sigma1 = 0"),
    ("stability", 0, "stable loop", ""),
    ("stability --model coulomb.toml --kp 1.6 --ki 0.16", 0, "stable loop", ""),
    # a transfer function that is typed; its decimals are exact
    ("spr --num 1,10 --den 1,2,0.5", 1, "not SPR: T(s) = [1, 10]/[1, 2, 0.5]\n", ""),
    ("bandwidth --num 1 --den 1,0", 1, "no bandwidth: T(s) = [1]/[1, 0]\n",
     "T(0) is infinite, so there is no DC gain"),
    ("bandwidth --num=1 --den=1,-1", 1, "unstable T: T(s) = [1]/[1, -1]", ""),
    ("stability --num 100 --den 1,0 --dead-time 0.01", 0, "stable loop", "exp(-0.01 s)"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "code", "begins", "words"), SAID)
def test_the_answer_in_words(capsys, line, code, begins, words):
    got, out, _ = run(capsys, line)
    assert got == code and out.startswith(begins) and words in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 100


REFUSED = [
    ("l2 --num 1 --den 1,x", "--den is '1,x', but numbers in descending powers"),
    ("l2 --num 1 --den 1e400", "--den is '1e400', but numbers"),
    ("l2 --num 1 --den 0", "--den is zero"),
    ("l2 --num 1", "--den is missing"),
    ("spr --den 1", "--num is missing"),
    ("spr --dt 0.1", "--dt is the sample time of T(z): give --num and --den too"),
    ("spr --num 1 --den 1 --dt -1", "-1 is not above 0"),
    ("spr --plot a.gif", "--plot a.gif: the picture must be a file .png"),
    ("spr --plot /no/such/folder/a.png", "--plot /no/such/folder/a.png: there is no folder"),
    ("passivity --num 1 --den 1,2", "--num: passivity is about"),
    ("spr --ki 1 --tau 1 --leak 1", "tau and leak"),
    ("bandwidth --dead-time -1", "dead_time is -1 s"),
    ("spr --model coulomb.toml --kp 1", "the model has no sigma0"),
    ("l2 --model coulomb.toml", "the model has no sigma0"),
    ("passivity --model coulomb.toml", "passivity_check needs sigma1, Fc, Fs, Fv, vs"),
    ("l2 --model part.toml", "parameter J is None"),
    ("", "are required: property"),
    ("--kp 3", "are required: property"),
    ("foo", "no property 'foo' (known: l2, spr, bandwidth, stability, passivity)"),
    ("bandwith", "there is no property 'bandwith' (did you mean bandwidth?)"),
    ("SPR", "there is no property 'SPR' (did you mean spr?)"),
    ("l2 --k2 3", "no option '--k2' (did you mean --K2?)"),
]


@pytest.mark.parametrize(("line", "words"), REFUSED)
def test_what_cannot_be_understood_is_one_sentence(capsys, line, words):
    code, out, err = run(capsys, line)
    assert code == 2 and out == "" and words in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("line", "names", "used"),
    [
        ("spr --prefilter --half-power --K2 3", "--K2, --prefilter, --half-power: not used", "kp"),
        ("l2 --leak 3 --derivative-filter 1", "--leak, --derivative-filter: not used", "K2"),
        ("l2 --dead-time 0.01", "--dead-time: not used", "K2"),
        ("passivity --kp 3", "--kp: not used", "K2"),
        ("bandwidth --num 1 --den 1,1 --position --kp 3 --half-power", "--kp, --position: not",
         "half-power"),
    ],
)  # fmt: skip
def test_options_without_a_part_are_named(capsys, line, names, used):
    err = run(capsys, line)[2]
    assert f"does not depend on {names}" in err and f"--{used}:" not in err


@pytest.mark.parametrize(
    ("options", "gains"),
    [
        ("", {"kp": 15.0, "ki": 1.55, "kd": 0.0}),
        ("--velocity", {"kp": 1.6, "ki": 0.16, "kd": 0.0}),
        ("--kd 2", {"kp": 0.0, "ki": 0.0, "kd": 2.0}),
        ("--kp 1 --ki 2 --tau 0.5", {"kp": 1.0, "ki": 2.0, "kd": 0.0, "tau": 0.5}),
    ],
)
def test_gains_not_given_are_zero_but_the_paper_has_some(capsys, options, gains):
    found = json.loads(run(capsys, f"spr --json {options}")[1])
    assert found["gains"] == gains
    assert found["loop"] == ("velocity" if "--velocity" in options else "position")


def test_the_suggested_repair_works_when_typed(capsys):
    sentence = facts(capsys, "spr", 1)["repair"]
    assert "0.9534" in sentence and "0.01033" in sentence
    assert facts(capsys, "spr --kp 15 --ki 1.55 --kd 0.9534 --leak 0.01033")["repair"] is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "spr",
        "bandwidth --num 1,0.2 --den 1,-0.4 --dt 0.1",
    ],
)
def test_the_verdict_is_drawn_into_a_file(capsys, tmp_path, line):
    file = tmp_path / "out" / "check.png"
    file.parent.mkdir()
    code, out, err = run(capsys, f"{line} --plot {file} --json")
    assert code in (0, 1) and json.loads(out)["check"] == line.split()[0]
    assert file.read_bytes()[:4] == b"\x89PNG" and f"picture: {file}" in err
    assert [*file.parent.iterdir()] == [file]


def test_stability_says_how_much_more_dead_time_the_loop_stands(capsys):
    margin = facts(capsys, "stability")["delay_margin"]
    assert margin == pytest.approx(2.16e-3, rel=1e-2)
    for late, begins in ((0.99 * margin, "stable"), (1.01 * margin, "unstable")):
        code, out, _ = run(capsys, f"stability --dead-time {late}")
        assert (code == 0) == (begins == "stable") and out.startswith(begins)
    out = run(capsys, "stability --num 100 --den 1,0 --dead-time 0.01")[1]
    assert "delay_margin              0.00570796 s" in out
    hertz = [facts(capsys, f"bandwidth {o}")["hertz"] for o in ("", "--dead-time 0")]
    assert hertz[0] == hertz[1]
    assert facts(capsys, "bandwidth --dead-time 0.001")["hertz"] > 2 * hertz[0]


def test_stability_gives_all_margins_of_a_sampled_loop(capsys):
    line = "stability --num 0.5,0.4 --den 1,-1.2,0.2 --dt 0.01"
    found = facts(capsys, line)
    for margin in ("gain_margin", "phase_margin", "modulus_margin", "delay_margin"):
        assert found[margin] > 0 and 0 < found[f"{margin}_frequency"] <= 315
    assert found["Ms"] == pytest.approx(1 / found["modulus_margin"])


def test_passivity_of_the_friction_says_which_values_would_do(capsys, tmp_path):
    code, out, _ = run(capsys, "passivity")
    assert code == 1 and out.startswith("friction that is not passive")
    assert "largest_sigma1  0.1026 N m s/rad" in out and "4.51246 rad/s" in out
    least = facts(capsys, "passivity", 1)["least_Fv"]
    write_model(Model.of(table1()).with_values({"Fv": least}), tmp_path / "drive.toml")
    assert run(capsys, "passivity --model drive.toml")[0] == 0

"""A misspelt name of a column, a role, a file or a command: one sentence that names the right one.

The hint is a sentence of its own where it needs one, and gives the option to type.
"""

import pytest

from lugrectl import InputError, diagnose, read_record
from lugrectl.cli import main

from ..cases.logs import csv


@pytest.mark.parametrize(
    ("head", "end"),
    [
        ("t,u,a2,thetta", "If 'thetta' is theta, rename it, or give columns=\"theta=thetta\"."),
        ("t,torqe,w,theta", "If 'torqe' is u, rename it, or give columns=\"u=torqe\"."),
        ("t,u,veloctiy,a", "If 'veloctiy' is w, rename it, or give columns=\"w=veloctiy\"."),
        ("t,trq val,w,theta", "If 'trq val' is u, rename it, or give columns=\"u=trq val\"."),
        ("tme,u,w,theta", "If 'tme' is t, rename it, or give columns=\"t=tme\", or give rate=HZ."),
        ("t,u,p,qq", ': name the column with columns="theta=NAME".'),
    ],
)
def test_a_misspelt_column_is_named_with_the_option_to_type(tmp_path, head, end):
    with pytest.raises(InputError) as no:
        read_record(csv(tmp_path, head))
    assert str(no.value).endswith(end) and "did you mean" not in str(no.value)


def test_a_column_that_has_a_role_is_not_offered_for_another(tmp_path):
    with pytest.raises(InputError) as no:
        read_record(csv(tmp_path, "t,u,thet a,tau"), columns="u=u,t=tau")
    assert "'tau' is" not in str(no.value)


@pytest.mark.parametrize(
    ("option", "given", "hint"),
    [
        ("columns", "thta=theta", "no role 'thta' (did you mean 'theta'?)"),
        ("columns", "theta=thta", "(did you mean 'theta'?); its columns are"),
        ("scale", "torque=2", "no role 'torque' (torque is 'u')"),
        ("units", "speed=rpm", "no role 'speed' (speed is 'w')"),
    ],
)
def test_a_misspelt_role_is_named(tmp_path, option, given, hint):
    with pytest.raises(InputError) as no:
        read_record(csv(tmp_path), **{option: given})
    assert hint in str(no.value)


def test_a_misspelt_file_is_named(tmp_path):
    path = csv(tmp_path, name="bench-run.csv")
    with pytest.raises(InputError, match=r"no such file \(did you mean .*bench-run.csv\?\)"):
        read_record(path.with_name("bench-run.cvs"))
    (tmp_path / "servo.toml").write_text("[plant]\n")
    with pytest.raises(InputError, match=r"no such model file \(did you mean .*servo.toml\?\)"):
        diagnose(path, tmp_path / "sevro.toml")
    with pytest.raises(InputError, match=r"no such file\.$"):
        read_record(tmp_path / "other.dat")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("diagnos run.csv", "there is no command 'diagnos' (did you mean diagnose?)"),
        ("diagnose run.csv --modle my.toml", "there is no option --modle (did you mean --model?)"),
        ("diagnose run.csv", "required: --model (lugrectl model > my.toml writes one"),
    ],
)
def test_a_misspelt_command_or_option_is_named(capsys, line, said):
    assert main(line.split()) == 2
    assert said in capsys.readouterr().err


def test_a_current_with_a_german_name_is_known(tmp_path):
    path = tmp_path / "run.csv"
    read = csv(tmp_path, "Zeit [s],Strom [A],Geschwindigkeit,Winkel", name="run.csv")
    assert read == path and read_record(path, scale="u=0.35").w is not None

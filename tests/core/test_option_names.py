"""A sentence names an option as it is typed on the command line, and as an argument in Python."""

import ast
import re
from functools import partial
from pathlib import Path

import pytest

import lugrectl as lg
from lugrectl.cli import main
from lugrectl.core.jobs import run_jobs
from lugrectl.core.option_names import on_command_line, option

PACKAGE = Path(lg.__file__).parent
TYPED = re.compile(r"(?<![\w-])--[a-z]")


@pytest.mark.parametrize(
    ("given", "typed", "argument"),
    [
        (("time_limit",), "--time-limit", "time_limit"),
        (("rate", "1000.5"), "--rate 1000.5", "rate=1000.5"),
        (("rate", "HZ"), "--rate HZ", "rate=HZ"),
        (("units", "t=ms"), "--units t=ms", 'units="t=ms"'),
        (("scale", "u=-1"), "--scale u=-1", 'scale="u=-1"'),
        (("units", "u=mN m"), '--units "u=mN m"', 'units="u=mN m"'),
        (("blocks", "FILE.py"), "--blocks FILE.py", 'lg.load_blocks("FILE.py")'),
    ],
)
def test_an_option_has_the_name_that_its_reader_can_give(given, typed, argument):
    assert option(*given) == argument
    with on_command_line():
        assert option(*given) == typed
    assert option(*given) == argument


def test_the_command_line_names_what_can_be_typed(tmp_path, capsys):
    path = tmp_path / "run.csv"
    path.write_text("t,current,w\n" + "".join(f"{i},1,{i}\n" for i in range(20)))
    assert main(["plot", str(path), "--out", str(tmp_path / "a.png")]) == 2
    assert "give --scale u=FACTOR" in capsys.readouterr().err
    with pytest.raises(lg.InputError, match='give scale="u=FACTOR"'):
        lg.read_record(path)


def test_other_processes_speak_as_the_one_that_began_them():
    rate = partial(option, "rate")
    with on_command_line():
        assert dict(run_jobs(rate, ["HZ", "HZ"], jobs=2)) == dict.fromkeys((0, 1), "--rate HZ")
    assert dict(run_jobs(rate, ["HZ", "HZ"], jobs=2)) == dict.fromkeys((0, 1), "rate=HZ")


def typed_options(path):
    """Texts outside docstrings that name an option as it is typed."""
    text = path.read_text(encoding="utf-8")
    if not TYPED.search(text):
        return []
    tree = ast.parse(text)
    homes = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docs = {id(n.body[0].value) for n in ast.walk(tree)
            if isinstance(n, homes) and n.body and isinstance(n.body[0], ast.Expr)}  # fmt: skip
    return [f"{path.name}:{n.lineno}: {n.value!r}" for n in ast.walk(tree)
            if isinstance(n, ast.Constant) and isinstance(n.value, str)
            and id(n) not in docs and TYPED.search(n.value)]  # fmt: skip


def test_no_sentence_but_those_of_the_command_line_names_an_option_as_typed(tmp_path):
    files = [p for p in PACKAGE.rglob("*.py") if p.relative_to(PACKAGE).parts[0] != "cli"]
    assert len(files) > 100
    assert [said for path in files for said in typed_options(path)] == []
    bad = tmp_path / "bad.py"
    bad.write_text('"""As in --rate."""\nSAID = f"give --rate {1}"\n')
    assert typed_options(bad) == ["bad.py:2: 'give --rate '"]

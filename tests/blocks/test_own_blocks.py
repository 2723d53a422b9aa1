"""Blocks of one's own: what a declaration must say, and where it may stand."""

import inspect
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest

import lugrectl as lg
from lugrectl.blocks.block import REGISTRY
from lugrectl.blocks.model import Sent
from lugrectl.cli import main
from lugrectl.cli.options import parser

PI = math.pi
C = lg.P(0.0, "N m s/rad", 0.0, neutral=0.0)
PLAIN = lg.P(0.1, "N m s/rad", 0.0)
LIMIT, TIME = lg.P(math.inf, "N m", 0.0, neutral=math.inf), lg.P(0.0, "s", 0.0, neutral=0.0)


def lagging(u, x, T=TIME):
    return x


def effect(function, **options):
    return lg.block("effect", **{"out": "d", "acts": "torque", "name": "mine", **options})(function)


def beyond(k, low=0.0, high=2.0, **more):
    return lambda w, c=C, k=lg.P(k, "1", low, high, **more): c * k * w


WRONG = {
    "acts": (lambda: effect(lambda w, c=C: c * w, acts="torqe"), "'torqe'.*mean 'torque'"),
    "level": (lambda: effect(lambda w, c=C: c * w, acts="+Fcc"), r"'\+Fcc'.*mean 'Fc'"),
    "kind": (lambda: lg.block("efect", out="d")(lambda w: w), "'efect'; did you mean 'effect'"),
    "surplus": (lambda: effect(lambda w, c=C: (c * w, w, w)), "returns 3 values, but 1 are"),
    "too few": (lambda: effect(lagging, acts="input", states="x"), "2 are declared.*rate of x"),
    "no return": (lambda: effect(lambda w, c=C: None), "the output d is None"),
    "number": (lambda: effect(lambda w, c=0.1: c * w), r"default of c is 0\.1.*c=P\(0\.1, "),
    "stars": (lambda: effect(lambda *signals, c=C: c * signals[0]), r"takes \*signals"),
    "no neutral value": (lambda: effect(lambda w, c=PLAIN: c * w), "no neutral value"),
    "not neutral": (
        lambda: effect(lambda w, c=C: c * w + 0.2),
        r"with c = 0.*d is 0\.2 instead of 0",
    ),
    "not neutral, u": (
        lambda: effect(
            lambda u, limit=LIMIT: 0.9 * np.clip(u, -limit, limit), acts="input", out="u"
        ),
        "change nothing, but u",
    ),
    "signal": (lambda: effect(lambda omega, c=C: c * omega), "reads omega, a signal that no drive"),
    "raises": (lambda: effect(lambda w, c=C: c * w["x"]), "cannot be run"),
    "default": (lambda: effect(beyond(5.0)), "default of k is 5, outside its bounds of 0 to 2\\."),
    "choices": (lambda: effect(beyond(1.0, choices=(0.0, 2.0))), "is 1, none of its choices 0, 2"),
    "out": (lambda: effect(lambda w, c=C: c * w, out=""), "out names no output"),
    "start": (lambda: effect(lagging, acts="input", states="x", start="v"), "start names 'v'"),
    "sensor": (lambda: effect(lambda w, c=C: c * w, acts="sensor"), "outputs must be w_m theta_m"),
    "acts of a law": (
        lambda: lg.block("friction", out="F", acts="torque")(lambda w, c=C: c * w),
        "acts belongs to effects",
    ),
}


@pytest.mark.parametrize("declare, words", WRONG.values(), ids=WRONG)
def test_a_wrong_declaration_is_one_sentence(declare, words):
    with pytest.raises(lg.InputError, match=words) as refused:
        declare()
    assert "\n" not in str(refused.value)


def test_a_helper_may_stand_below_the_block():
    made = effect(lambda w, c=C: _not_yet(c * w))  # noqa: F821
    assert made.name == "mine"


def test_an_effect_that_acts_on_nothing_stands_alone_only():
    effect(lambda w, c=C: c * w, acts="")
    assert lg.effect("mine", c=2.0).ninputs == 1
    with pytest.raises(lg.InputError, match="mine acts on nothing inside a drive"):
        lg.plant(lg.Model.of(lg.table1()).with_effect("mine", {"c": 2.0}))


def test_a_block_has_the_docstring_and_signature_of_its_function():
    def documented(w, c=C):
        """r_e = c w."""
        return c * w

    made = effect(documented)
    assert made.__doc__ == "r_e = c w."
    assert made.__wrapped__ is documented
    assert [*inspect.signature(made).parameters] == ["w", "c"]
    assert REGISTRY["effect", "gravity"].__doc__.startswith("r_e")


MINE = '''import lugrectl as lg


@lg.block("effect", out="d", acts="torque", confused="quadratic_drag")
def cubic_of_file(w, coefficient=lg.P(0.0, "N m s3/rad3", 0.0, neutral=0.0)):
    """r_e = c w^3."""
    return coefficient * w**3


@lg.block("friction", out="F")
def law_of_file(w, Fv=lg.P(0.01, "N m s/rad", 0.0), q=lg.P(0.0, "N m s2/rad2", 0.0)):
    """F = Fv w + q w |w|."""
    return Fv * w + q * w * abs(w)


@lg.block("observer", out="Fhat", states="Fhat")
def observer_of_file(w, u, Fhat, J=lg.P(0.0022, "kg m2", 1e-12), L=lg.P(50.0, "1/s", 0.0)):
    """dFhat = L (u - Fhat)."""
    return L * (u - Fhat)
'''


NAMES = ["cubic_of_file", "law_of_file", "observer_of_file"]


MODEL = '{blocks}[plant]\nJ = 0.002\n[friction]\nmodel = "law_of_file"\nFv = 0.02\nq = 0.001\n'

MODEL += '[[effects]]\nname = "cubic_of_file"\ncoefficient = 0.01\n'


@pytest.fixture
def mine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(MINE)
    return tmp_path / "mine.py"


def refused(path):
    with pytest.raises(lg.InputError) as said:
        lg.load_blocks(path)
    assert "\n" not in str(said.value)
    return str(said.value)


def test_a_file_declares_effects_laws_and_observers(mine):
    assert lg.load_blocks("mine.py") == NAMES
    assert lg.effects()["cubic_of_file"].equation == "r_e = c w^3"
    model = lg.Model.of(J=0.002, friction="law_of_file", Fv=0.02, q=0.0, effects="cubic_of_file")
    assert "Fv = 0.02" in repr(model) or "0.02" in repr(model)
    loop = lg.velocity_loop(lg.table1(), observer="observer_of_file")
    t = np.arange(0.0, 0.05, 1e-3)
    assert np.ptp(lg.simulate(loop, t, np.ones_like(t)).outputs["Fhat"]) > 0


def test_a_file_may_be_loaded_again_and_changed(mine, monkeypatch):
    lg.load_blocks(mine)
    before = REGISTRY["effect", "cubic_of_file"]
    assert lg.load_blocks("./mine.py") == NAMES and REGISTRY["effect", "cubic_of_file"] is before
    monkeypatch.syspath_prepend(mine.parent)
    import mine as imported  # the same file as a module

    assert imported.cubic_of_file.name == "cubic_of_file"
    mine.write_text(MINE.replace("w**3", "w**5").replace("w^3", "w^5"))
    lg.load_blocks(mine)
    assert lg.effects()["cubic_of_file"].equation == "r_e = c w^5"
    del sys.modules["mine"]


def test_what_a_file_needs_may_stand_beside_it(mine):
    (mine.parent / "helper_of_mine.py").write_text("POWER = 3\n")
    mine.write_text("from helper_of_mine import POWER\n" + MINE.replace("w**3", "w**POWER"))
    lg.load_blocks(mine)
    assert str(mine.parent) not in sys.path
    del sys.modules["helper_of_mine"]


BROKEN = {
    "syntax": ("def f(:\n", "line 1: SyntaxError"),
    "name": ("import lugrectl\n\nprint(nowhere)\n", "line 3: NameError: name 'nowhere'"),
    "declaration": (
        MINE.replace('"torque"', '"torqe"'),
        "line 4: cubic_of_file: it acts on",
    ),
    "exit": ("import sys\nsys.exit(7)\n", "line 2: SystemExit: 7"),
    "nothing": ("a = 3\n", "no block is declared"),
    "NUL": ("a = 3\0\n", "mine.py"),
    "name taken": (MINE.replace("cubic_of_file", "gravity"), "'gravity' exists"),
    "half": (MINE + "1 / 0\n", "ZeroDivisionError"),
}


@pytest.mark.parametrize(("text", "words"), BROKEN.values(), ids=BROKEN)
def test_a_broken_file_is_one_sentence_with_its_line_and_leaves_nothing(mine, text, words):
    before = dict(REGISTRY)
    mine.write_text(text)
    said = refused(mine)
    assert said.startswith(str(mine)) and words in said
    assert dict(REGISTRY) == before


@pytest.mark.parametrize("path", ["min.py", ".", 3, None, "a\0b"])
def test_what_is_no_file_of_blocks_is_one_sentence(mine, path):
    said = refused(path)
    assert path != "min.py" or "did you mean mine.py" in said


def commands():
    made = next(a for a in parser()._actions if a.dest == "command")
    return list(made.choices)


@pytest.mark.parametrize("command", commands())
def test_every_command_takes_blocks_and_refuses_a_broken_file(command, mine, capsys):
    needed = dict.fromkeys(["diagnose", "identify", "bode"], ["r.csv", "--model", "m.toml"])
    needed |= {"plot": ["r.csv"], "check": ["l2"], "hunt": ["--model", "m.toml"]}
    needed |= {"assure": ["report.json"]}
    mine.write_text("import lugrectl\n1 / 0\n")
    code = main([command, *needed.get(command, []), "--blocks", "mine.py"])
    out, err = capsys.readouterr()
    assert code == 2 and out == ""
    assert err.strip() == f"lugrectl: error: {mine}, line 2: ZeroDivisionError: division by zero."


def test_a_model_file_names_the_file_beside_it(mine, tmp_path, monkeypatch):
    for blocks in ('blocks = ["mine.py"]\n', 'blocks = "mine.py"\n'):
        (tmp_path / "m.toml").write_text(MODEL.format(blocks=blocks))
        monkeypatch.chdir("/")
        model = lg.read_model(tmp_path / "m.toml")
        assert model.blocks == (str(mine),) and model.effects[0].key == "cubic_of_file"


def test_what_is_written_names_the_file_and_is_read_in_a_new_process(mine, tmp_path):
    lg.load_blocks(mine)
    (tmp_path / "m.toml").write_text(MODEL.format(blocks=""))
    model = lg.read_model(tmp_path / "m.toml")
    (tmp_path / "elsewhere").mkdir()
    lg.write_model(lg.Model.of(model, J=0.003), tmp_path / "elsewhere" / "n.toml")
    assert 'blocks = ["../mine.py"]' in (tmp_path / "elsewhere" / "n.toml").read_text()
    (tmp_path / "sent").write_bytes(pickle.dumps(Sent.of(model)))
    code = (
        "import pickle, lugrectl as lg\n"
        "print(lg.read_model('elsewhere/n.toml').effects[0].block.equation)\n"
    )
    other = "import pickle\nprint(pickle.loads(open('sent', 'rb').read()).open().effects[0].block)"
    for script, words in ((code, "r_e = c w^3"), (other, "Block cubic_of_file")):
        done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
        assert words in done.stdout, done.stderr


@pytest.mark.parametrize(
    ("blocks", "words"),
    [
        ("blocks = 3\n", "blocks must be a list of files"),
        ('blocks = ["no.py"]\n', "No such file"),
        ('blocks = ["broken.py"]\n', "broken.py, line 1: NameError"),
    ],
)
def test_a_model_file_with_wrong_blocks_is_one_sentence(mine, tmp_path, blocks, words):
    (tmp_path / "broken.py").write_text("nowhere\n")
    (tmp_path / "m.toml").write_text(MODEL.format(blocks=blocks))
    with pytest.raises(lg.InputError) as said:
        lg.read_model(tmp_path / "m.toml")
    assert str(said.value).startswith(str(tmp_path / "m.toml")) and words in str(said.value)


def wave(name, shape, **more):
    def function(
        theta,
        amplitude=lg.P(0.0, "N m", 0.0, neutral=0.0),
        phase=lg.P(0.0, "rad", -PI, PI, **more),
    ):
        return amplitude * shape(12 * theta + phase)

    return lg.block("effect", out="d", acts="torque", name=name)(function)


def test_a_span_that_the_function_does_not_fulfil_is_not_used():
    true = {"span": (0.0, PI / 2), "angle": True}
    assert wave("sine", np.sin, **true).parameters["phase"].span == (0.0, PI / 2)
    assert wave("square", lambda x: np.tanh(4 * np.sin(x)), **true).parameters["phase"].span is None
    assert wave("none", np.sin, span=(0.0, PI / 2)).parameters["phase"].span is None

    @lg.block("effect", out="d", acts="torque", name="spring")
    def spring(theta, k=lg.P(0.0, "N m", 0.0, neutral=0.0), rest=lg.P(0.0, "rad", span=(0.0, 1.0))):
        return k * (theta - rest)

    assert spring.parameters["rest"].span == (0.0, 1.0)

"""What README prints is run as it is printed; its figures are those of the result files."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest

import lugrectl as lg
from lugrectl.cli import main

from ..cases.blind_results import effect, line, ripple
from ..scores import counts, readme

TEXT = (Path(__file__).parents[2] / "README.md").read_text()


def block(text: str, language: str = "") -> str:
    """The first fenced block of a language in a part of README."""
    found = re.search(rf"^```{language}\n(.*?)^```", text, re.M | re.S)
    assert found
    return found[1]


def section(title: str) -> str:
    return TEXT.split(f"## {title}\n")[1].split("\n## ")[0]


OWN = section("In Python").split("--blocks mine.py")[1]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the own blocks of README, and a short log at a sampling rate of 250 Hz."""
    head = "import numpy as np\nimport lugrectl as lg\n"
    (tmp_path / "mine.py").write_text(head + block(OWN, "python"))
    t = np.arange(0, 4, 4e-3)
    u = np.sin(2.0 * t) * (0.4 + 0.1 * np.sin(0.5 * t))
    w = lg.simulate(lg.plant(lg.table1()), t, {"u": u}, hold=True).outputs["w"]
    noise = np.random.default_rng(0).normal(0, 1e-3, len(t))
    lines = np.c_[t, u, w + noise]
    np.savetxt(tmp_path / "run.csv", lines, "%.9g", ",", header="t,u,w [rad/s]", comments="")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_commands_for_an_own_log(folder, capsys):
    lines = block(section("Your own log")).splitlines()
    activate, template, diagnose = (shlex.split(line, comments=True) for line in lines)
    assert activate[0] == "source" and template[2:3] == [">"] and main(template[1:2]) == 0
    (folder / template[3]).write_text(capsys.readouterr().out)
    assert main(diagnose[1:]) == 0
    assert capsys.readouterr().out.startswith("adequate\n")
    assert (folder / "report" / "report.html").stat().st_size > 10_000


def test_the_options_for_names_units_and_scales(folder):
    options = re.search(r"`(--columns u=vir [^`]+)`", " ".join(TEXT.split()))
    t = np.arange(0.0, 4.0, 0.01)
    vir, theta = np.cos(5.0 * t), 90.0 * np.sin(2.0 * t)
    head = "t,vir,theta"
    np.savetxt("log.csv", np.c_[t, vir, theta], "%.9g", ",", header=head, comments="")
    words = shlex.split(options[1])
    given = dict(zip([w.strip("-") for w in words[::2]], words[1::2], strict=True))
    record = lg.read_record("log.csv", **given)
    np.testing.assert_allclose(record.u, 35.15 * vir, atol=1e-7)
    np.testing.assert_allclose(record.theta, np.radians(theta), atol=1e-9)


@pytest.mark.slow
@pytest.mark.sample
@pytest.mark.filterwarnings("ignore:.*non-interactive")
def test_the_lines_of_python(folder, capsys):
    names = {}
    exec(compile(block(section("In Python"), "python"), "README.md", "exec"), names)
    assert names["result"].verdict == "found"
    assert [effect.name for effect in names["result"].effects] == ["torque_ripple"]
    assert "found: torque_ripple" in capsys.readouterr().out
    assert (folder / "report" / "model.toml").exists()
    plt.close("all")


def test_the_blocks_of_ones_own_are_loaded_fitted_and_simulated(folder):
    assert lg.load_blocks(folder / "mine.py") == ["cubic_drag", "smooth", "momentum"]
    drive = lg.Model.of(J=0.002, friction="smooth", Fc=0.3, effects="cubic_drag")
    assert [part.key for part in drive.effects] == ["cubic_drag"]
    t = np.arange(0.0, 0.2, 1e-3)
    loop = lg.velocity_loop(lg.table1(), observer="momentum")
    moved = lg.simulate(loop, t, np.ones_like(t)).outputs
    assert abs(moved["Fhat"][-1] - moved["F"][-1]) < 0.05 * moved["F"][-1]
    fitted = re.search(r"`(lg\.identify\([^`]+)`", OWN)
    assert fitted and 'lg.Model.of(friction="smooth")' in fitted[1]
    found = eval(fitted[1], {"lg": lg})
    assert found.model.J == pytest.approx(lg.table1().J, rel=0.05)
    assert found.model.values()["Fc"] == pytest.approx(lg.table1().Fc, rel=0.1)


def test_it_stays_short():
    assert len(TEXT.split()) <= 900


def test_the_checks_and_the_lists(capsys):
    said = section("What there is")
    assert "`lugrectl check l2|spr|bandwidth|stability|passivity`" in TEXT
    assert main(["check", "l2"]) == 0 and capsys.readouterr().out
    assert main(["effects"]) == 0
    assert f"**Effects**: {len(lg.effects())}," in said
    for listed in ("laws", "observers", "controllers"):
        assert f"`lg.{listed}()`" in said and len(getattr(lg, listed)())


def test_readme_says_what_the_result_files_say():
    text = readme.README.read_text()
    assert sorted(m[2] for m in readme.BLOCK.finditer(text)) == sorted(readme.BLOCKS)
    assert readme.filled(text) == text


def test_the_check_fails_until_the_figures_are_written(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(readme, "README", tmp_path / "README.md")
    readme.README.write_text("<!-- figures:demo -->\n<!-- end -->\n")
    assert readme.main(["--check"]) == 1
    assert "run python -m tests.scores.readme" in capsys.readouterr().err
    assert readme.main([]) == 0 and readme.main(["--check"]) == 0
    assert "found: torque_ripple" in readme.README.read_text()


def test_there_are_six_counts():
    pair = ["gravity", "stribeck"]
    lines = [
        ripple(0.0401, [0.039, 0.041]),
        line(["gravity"], "ambiguous", effect("gravity", ties=["return_spring"])),
        line(["gravity"], "found", effect("gravity"), strength="weak"),
        line(pair, "found", *map(effect, pair), kind="pair"),
        line(pair, "found", *map(effect, [*pair, "hard_stop"]), kind="pair"),
        line([], "adequate", kind="none"),
        line([], "unexplained", kind="none", depends_on=["t"]),
        line(["torque_bumps"], "unexplained", kind="stranger", depends_on=["theta"]),
        line(["torque_bumps"], "adequate", kind="stranger"),
        line(["gravity"], "adequate", problems=["unfit"]),
    ]
    # the gravity of line() hides no values, the ripple's harmonic is a count
    assert [said for _, said in counts.rows(lines)] == [
        "1 of 2, 1 more ambiguous",
        "1 of 1",
        "2 of 2, 1 alone",
        "1 of 2",
        "1 of 2, the first signal right in 1",
        "2 of 2",
    ]


def test_the_kept_results_are_known():
    """Each result file of a blind run has its commit and command."""
    known = json.loads((readme.RESULTS / "about.json").read_text())
    assert {"commit", "command"} <= set(known[readme.newest().name])


def test_times_are_measured_by_a_command():
    """A short form of it: every figure that README shows is there."""
    from ..benchmarks import front as times

    assert times.sweep(members=2)["sweep_s"] > 0.0
    assert set(times.RECORDS) == {"nothing missing", "one effect"}
    assert times.commit() == "" or len(times.commit()) >= 7

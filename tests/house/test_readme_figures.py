"""README's figures are written from the result files, never typed."""

import json

import pytest

from ..cases.blind_results import effect, line, ripple
from ..scores import counts, readme


def test_readme_says_what_the_result_files_say():
    text = readme.README.read_text()
    assert sorted(readme.marks(text)) == sorted(readme.BLOCKS)
    assert readme.filled(text, {name: make() for name, make in readme.BLOCKS.items()}) == text


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A README and result files of its own."""
    monkeypatch.setattr(readme, "README", tmp_path / "README.md")
    monkeypatch.setattr(readme, "RESULTS", tmp_path)
    marked = [f"<!-- figures:{name} -->\n<!-- end -->\n" for name in readme.BLOCKS]
    readme.README.write_text("".join(marked))
    (tmp_path / "demo.txt").write_text("found: gravity\n")
    (tmp_path / "blind-2030-02-03.jsonl").write_text(json.dumps(ripple(0.0401, [0.039, 0.041])))
    (tmp_path / "about.json").write_text('{"blind-2030-02-03.jsonl": {"commit": "abc1234"}}')
    seconds = {kind: {"seconds": [7.4, 8.6]} for kind in ("nothing missing", "one effect")}
    speed = {"date": "2030-02-03", "commit": "abc1234", "cores": 2, "processor": "a processor",
             "simulate_ms": 1.65, "times_faster": 3614.0, "members": 1000, "sweep_s": 1.31,
             "diagnose": seconds}  # fmt: skip
    (tmp_path / "speed.json").write_text(json.dumps(speed))
    return tmp_path


def test_the_check_fails_until_the_figures_are_written(folder, capsys):
    assert readme.main(["--check"]) == 1
    assert "run python -m tests.scores.readme" in capsys.readouterr().err
    assert readme.main([]) == 0
    assert readme.main(["--check"]) == 0
    text = readme.README.read_text()
    assert "|one effect, RMS 20 % of friction, named exactly|1 of 1|" in text
    assert "7 to 9 s with nothing missing" in text and "3600 times faster" in text
    assert "commit abc1234" in text


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
    files = [p.name for p in readme.RESULTS.glob("blind-*.jsonl")]
    assert files and all({"commit", "command"} <= set(known[name]) for name in files)


def test_times_are_measured_by_a_command():
    """A short form of it: every figure that README shows is there."""
    from ..benchmarks import front as times

    assert times.sweep(members=2)["sweep_s"] > 0.0
    assert set(times.RECORDS) == {"nothing missing", "one effect"}
    assert times.commit() == "" or len(times.commit()) >= 7

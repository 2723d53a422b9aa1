"""README's figures are written from the result files, never typed."""

import json

from ..cases.blind_results import effect, line, ripple
from ..scores import counts, readme


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
    files = [p.name for p in readme.RESULTS.glob("blind-*.jsonl")]
    assert files and all({"commit", "command"} <= set(known[name]) for name in files)


def test_times_are_measured_by_a_command():
    """A short form of it: every figure that README shows is there."""
    from ..benchmarks import front as times

    assert times.sweep(members=2)["sweep_s"] > 0.0
    assert set(times.RECORDS) == {"nothing missing", "one effect"}
    assert times.commit() == "" or len(times.commit()) >= 7

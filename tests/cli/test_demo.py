"""``lugrectl demo``: the main job on the record that ships."""

import json

from lugrectl.cli import main


def test_demo_names_the_effect_and_reaches_the_noise(tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["demo", "--json", "--out", str(out)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] == "found"
    error = answer["error"]
    assert error["augmented"] <= 1.2 * error["noise_floor"] < 0.1 * error["refitted"]
    assert sorted(p.name for p in out.iterdir()) == ["model.toml", "report.html", "report.json"]
    assert json.loads((out / "report.json").read_text())["error"] == error

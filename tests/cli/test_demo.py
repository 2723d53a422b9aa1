"""``lugrectl demo``: the main job on the record that ships."""

import json
import subprocess
import sys
from importlib import resources

from lugrectl.cli import main


def test_demo_names_the_effect_and_reaches_the_noise(tmp_path, capsys):
    out = tmp_path / "out"
    picture = tmp_path / "demo.png"
    assert main(["demo", "--json", "--out", str(out), "--plot", str(picture)]) == 0
    assert picture.stat().st_size > 10_000
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] == "found"
    error = answer["error"]
    assert error["augmented"] <= 1.2 * error["noise_floor"] < 0.1 * error["refitted"]
    assert sorted(p.name for p in out.iterdir()) == ["model.toml", "report.html", "report.json"]
    assert json.loads((out / "report.json").read_text())["error"] == error


def test_a_record_is_diagnosed_without_loading_python_control_or_matplotlib():
    folder = resources.files("lugrectl") / "demo"
    line = ["diagnose", str(folder / "record.csv"), "--model", str(folder / "model.toml")]
    code = (
        f"import sys, lugrectl.cli as c; code = c.main({line!r}); "
        "heavy = {'control', 'matplotlib', 'numba'} & set(sys.modules); "
        "sys.exit(f'{code} {heavy}' if code or heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0 and "found" in done.stdout.lower(), done.stderr

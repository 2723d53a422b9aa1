"""Plain English: words that readers stumble over stay out of code, README and notebooks."""

import ast
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WORDS = (
    r"hang|hangs|hung|foretell\w*|foretold|foresee\w*|foresaw|foreseen|mend\w*|told|untold|"
    r"lack|lacks|lacked|lacking|sought|gone\s+by|worth\s+a\s+word|worth\s+naming|strangers?"
)
BANNED = re.compile(rf"\b(?:{WORDS})\b", re.IGNORECASE)


def shown(path: Path) -> str:
    """What a reader sees of a file: of code its strings and comments, of notebooks no code."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py" and BANNED.search(text):
        nodes = ast.walk(ast.parse(text))
        said = [n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)]
        return "\n".join(said + re.findall(r"# .*", text))
    if path.suffix == ".ipynb":
        for cell in (cells := json.loads(text)["cells"]):
            cell["source"] = cell["source"] if cell["cell_type"] == "markdown" else []
        return json.dumps(cells).replace("\\n", " ")
    return text


@pytest.mark.parametrize("pattern", ["lugrectl/**/*.py", "README.md", "notebooks/*.ipynb"])
def test_banned_words_stay_out(pattern):
    files = sorted(ROOT.glob(pattern))
    assert files
    found = {str(path): BANNED.findall(shown(path)) for path in files}
    assert not {path: words for path, words in found.items() if words}

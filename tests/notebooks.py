"""``python -m tests.notebooks [NAME ...]``: execute the notebooks and store them with outputs.

Each runs in a fresh kernel in its own folder. What differs from run to run (times, kernel and
interpreter versions, cell ids) is left out, so that a new run changes only what is new.
"""

from __future__ import annotations

import base64
import io
import re
import sys
import time
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "notebooks"
LARGEST = 400_000  # bytes of a stored notebook
COLOURS = 64  # of a stored picture
WIDGET = "application/vnd.jupyter.widget-view+json"  # a progress bar that is gone
RICH = ("image/png", "text/html", "text/markdown")
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")
MEASURED = re.compile(
    r"\d m?s\b.*(?:took|faster|CPU)|seconds|times faster|version|date", re.IGNORECASE
)
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def paths() -> list[Path]:
    return sorted(FOLDER.glob("*.ipynb"))


def executed(path: Path, timeout: int = 1500):
    """The notebook with the outputs of a fresh kernel; an error of a cell is raised.

    ``timeout`` in s is for a cell that compiles all observers, with an empty cache and a busy core.
    """
    import nbclient
    import nbformat

    notebook, where = nbformat.read(path, as_version=4), {"metadata": {"path": str(path.parent)}}
    options = {"kernel_name": "python3", "record_timing": False, "resources": where}
    return nbclient.NotebookClient(notebook, timeout=timeout, **options).execute()


def smaller(png: str) -> str:
    """A picture in base64 with a palette, a third of the size."""
    from PIL import Image

    drawn = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    file = io.BytesIO()
    drawn.quantize(COLOURS).save(file, format="png", optimize=True)
    return base64.b64encode(file.getvalue()).decode()


def plain(notebook):
    """The notebook without what differs from run to run."""
    notebook.metadata = {"kernelspec": KERNEL, "language_info": {"name": "python"}}
    for i, cell in enumerate(notebook.cells):
        cell.id, cell.metadata = f"cell-{i}", {}
        if "outputs" in cell:
            cell.outputs = [o for o in cell.outputs if WIDGET not in o.get("data", {})]
        for output in cell.get("outputs", []):
            if "metadata" in output:
                output.metadata = {}
            data = output.get("data", {})
            if "image/png" in data:
                data["image/png"] = smaller(data["image/png"])
            if any(kind in data for kind in RICH):
                data.pop("text/plain", None)  # an address in memory, or the same again
    return notebook


def figures(notebook) -> list[list[float]]:
    """The numbers in the text that each code cell shows, without lines of measured times."""
    made = []
    for cell in notebook.cells:
        if cell.cell_type != "code":
            continue
        shown = [o for o in cell.outputs if not {*RICH[:2], WIDGET} & set(o.get("data", {}))]
        texts = [o.get("text", "") or o.get("data", {}).get("text/plain", "") for o in shown]
        lines = [x for x in "\n".join(texts).splitlines() if not MEASURED.search(x)]
        made.append([float(number) for line in lines for number in NUMBER.findall(line)])
    return made


if __name__ == "__main__":
    import nbformat

    for path in [FOLDER / f"{name}.ipynb" for name in sys.argv[1:]] or paths():
        start = time.perf_counter()
        nbformat.write(plain(executed(path)), path)
        size, taken = path.stat().st_size, time.perf_counter() - start
        print(f"{path.name}: {taken:.0f} s, {size / 1e3:.0f} kB", flush=True)
        if size > LARGEST:
            sys.exit(f"{path.name} is larger than {LARGEST / 1e3:.0f} kB")

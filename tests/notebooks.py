"""``python -m tests.notebooks [NAME ...]``: execute the notebooks and store them with outputs.

Each runs in a fresh kernel in its own folder. What differs from run to run (times, kernel and
interpreter versions, cell ids) is left out, so that a new run changes only what is new.
"""

from __future__ import annotations

import argparse
import base64
import io
import re
import sys
import time
from collections.abc import Sequence
from pathlib import Path

FOLDER = Path(__file__).parents[1] / "notebooks"
LARGEST = 400_000  # bytes of a stored notebook
COLOURS = 64  # of a stored picture
WIDGET = "application/vnd.jupyter.widget-view+json"  # a progress bar that is gone
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w.])")
MEASURED = re.compile(
    r"\d m?s\b.*(?:took|faster|CPU)|seconds|times faster|version|date", re.IGNORECASE
)
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}


def paths(names: Sequence[str] = ()) -> list[Path]:
    """The notebooks of these names, or all."""
    return [FOLDER / f"{n}.ipynb" for n in names] if names else sorted(FOLDER.glob("*.ipynb"))


def executed(path: Path, timeout: int = 1500):
    """The notebook with the outputs of a fresh kernel; an error of a cell is raised.

    ``timeout`` in s is for a cell that compiles all observers, with an empty cache and a busy core.
    """
    import nbclient
    import nbformat

    notebook = nbformat.read(path, as_version=4)
    client = nbclient.NotebookClient(
        notebook,
        timeout=timeout,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(path.parent)}},
    )
    return client.execute()


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
            if "image/png" in data or "text/html" in data or "text/markdown" in data:
                data.pop("text/plain", None)  # an address in memory, or the same again
    return notebook


def figures(notebook) -> list[list[float]]:
    """The numbers in the text that each code cell shows, without lines of measured times."""
    return [
        [
            float(number)
            for line in "\n".join(map(_shown, cell.outputs)).splitlines()
            if not MEASURED.search(line)
            for number in NUMBER.findall(line)
        ]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def _shown(output) -> str:
    data = output.get("data", {})
    if "image/png" in data or "text/html" in data or WIDGET in data:
        return ""
    return output.get("text", "") or data.get("text/plain", "")


def main(argv: Sequence[str] | None = None) -> int:
    import nbformat

    p = argparse.ArgumentParser(prog="python -m tests.notebooks", description=__doc__)
    p.add_argument("names", nargs="*", metavar="NAME", help="without .ipynb; all where left out")
    for path in paths(p.parse_args(argv).names):
        start = time.perf_counter()
        nbformat.write(plain(executed(path)), path)
        size, taken = path.stat().st_size, time.perf_counter() - start
        print(f"{path.name}: {taken:.0f} s, {size / 1e3:.0f} kB", flush=True)
        if size > LARGEST:
            print(f"{path.name} is larger than {LARGEST / 1e3:.0f} kB", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

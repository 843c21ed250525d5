"""The outputs of examples/tour.ipynb, which ships with them.

    python -m benchmarks.pages.notebook

Executes all cells in an empty folder and stores their outputs, with pictures of few colours and
without the times of the execution. It takes some minutes.
"""

from __future__ import annotations

import base64
import io
import tempfile
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from PIL import Image

from benchmarks.result_files import ROOT

TOUR = ROOT / "examples" / "tour.ipynb"
_WIDTH = 720  # pixels of a picture
_COLORS = 64


def execute(notebook: Any, folder: Path, **options: Any) -> None:
    """Executes the cells of a notebook in a folder; `options` are those of `execute`."""
    resources = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=900, resources=resources).execute(**options)


def smaller(png: str) -> str:
    """Returns a PNG in base64 as one with less pixels and colours."""
    picture = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    size = _WIDTH, round(picture.height * _WIDTH / picture.width)
    stream = io.BytesIO()
    picture.resize(size, Image.Resampling.LANCZOS).quantize(_COLORS).save(
        stream, "PNG", optimize=True
    )
    return base64.b64encode(stream.getvalue()).decode()


def main() -> None:
    """Executes the notebook and stores its outputs."""
    notebook: Any = nbformat.read(TOUR, as_version=4)  # type: ignore[no-untyped-call]
    metadata = dict(notebook.metadata)
    with tempfile.TemporaryDirectory() as folder:
        execute(notebook, Path(folder))
    notebook.metadata = nbformat.from_dict(metadata)  # type: ignore[no-untyped-call]
    for cell in notebook.cells:
        cell.metadata = nbformat.from_dict({})  # type: ignore[no-untyped-call]
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = smaller(output.data["image/png"])
    nbformat.write(notebook, TOUR)  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()

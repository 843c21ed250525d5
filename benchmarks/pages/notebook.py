"""The outputs of examples/step_by_step.ipynb, which ships with them, and its page in docs.

    python -m benchmarks.pages.notebook

Executes all cells in an empty folder and stores their outputs, with pictures of few colours and
without the times of the execution. Then it writes docs/step_by_step.md: the same cells with their
outputs. It takes a minute.
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

NOTEBOOK = ROOT / "examples" / "step_by_step.ipynb"
PAGE = ROOT / "docs" / "step_by_step.md"
_WIDTH = 720  # pixels of a picture
_COLORS = 64


def execute(notebook: Any, folder: Path, **options: Any) -> None:
    """Executes the cells of a notebook in a folder; `options` are those of `execute`."""
    resources = {"metadata": {"path": str(folder)}}
    client = NotebookClient(notebook, timeout=900, resources=resources, coalesce_streams=True)
    client.execute(**options)


def smaller(png: str) -> str:
    """Returns a PNG in base64 as one with less pixels and colours."""
    picture = Image.open(io.BytesIO(base64.b64decode(png))).convert("RGB")
    size = _WIDTH, round(picture.height * _WIDTH / picture.width)
    stream = io.BytesIO()
    picture.resize(size, Image.Resampling.LANCZOS).quantize(_COLORS).save(
        stream, "PNG", optimize=True
    )
    return base64.b64encode(stream.getvalue()).decode()


def page_of(notebook: Any) -> tuple[str, dict[str, bytes]]:
    """Returns the page of an executed notebook, and its pictures by their names in docs."""
    parts: list[str] = []
    pictures: dict[str, bytes] = {}
    heading = ""
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            parts.append(cell.source.replace("](../docs/", "]("))
            for line in cell.source.splitlines():
                heading = line.lstrip("# ") if line.startswith("#") else heading
            continue
        parts.append(f"```py\n{cell.source}\n```")
        for output in cell.outputs:
            if output.output_type == "stream":
                parts.append(f"```text\n{output.text.rstrip()}\n```")
            elif "image/png" in output.data:
                name = f"{PAGE.stem}/{len(pictures) + 1}.png"
                pictures[name] = base64.b64decode(output.data["image/png"])
                parts.append(f"![{heading}]({name})")
    return "\n\n".join(parts) + "\n", pictures


def write_page(notebook: Any) -> None:
    """Writes the page of an executed notebook, and its pictures in place of the old ones."""
    page, pictures = page_of(notebook)
    PAGE.write_text(page, encoding="utf-8")
    folder = PAGE.with_suffix("")
    folder.mkdir(exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    for name, picture in pictures.items():
        (PAGE.parent / name).write_bytes(picture)


def main() -> None:
    """Executes the notebook, stores its outputs, and writes the page."""
    notebook: Any = nbformat.read(NOTEBOOK, as_version=4)  # type: ignore[no-untyped-call]
    metadata = dict(notebook.metadata)
    with tempfile.TemporaryDirectory() as folder:
        execute(notebook, Path(folder))
    notebook.metadata = nbformat.from_dict(metadata)  # type: ignore[no-untyped-call]
    for cell in notebook.cells:
        cell.metadata = nbformat.from_dict({})  # type: ignore[no-untyped-call]
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                output.data["image/png"] = smaller(output.data["image/png"])
    nbformat.write(notebook, NOTEBOOK)  # type: ignore[no-untyped-call]
    write_page(notebook)


if __name__ == "__main__":
    main()

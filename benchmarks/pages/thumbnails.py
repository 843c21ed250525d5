"""The small pictures of README.md: the part of each picture that its row speaks of.

    python -m benchmarks.pages.thumbnails

Needs the pictures in docs/, which the other commands draw.
"""

from __future__ import annotations

from PIL import Image

from benchmarks.result_files import ROOT

_DOCS = ROOT / "docs"
_WIDTH = 480  # pixels; README shows them at about half of it
# Left, top, right and bottom of the part, as shares of the whole picture.
PARTS = {
    "diagnose": (0.0, 0.03, 0.46, 0.52),
    "page": (0.02, 0.13, 0.475, 0.58),
    "play": (0.0, 0.07, 1.0, 0.79),
    "run": (0.0, 0.05, 1.0, 0.3),
    "compare": (0.0, 0.0, 0.465, 0.87),
}


def main() -> None:
    """Writes a thumbnail of each picture into docs/thumbnails/."""
    folder = _DOCS / "thumbnails"
    folder.mkdir(exist_ok=True)
    for name, part in PARTS.items():
        with Image.open(_DOCS / f"{name}.png") as picture:
            sides = (picture.width, picture.height) * 2
            box = tuple(round(share * side) for share, side in zip(part, sides, strict=True))
            cropped = picture.convert("RGB").crop(box)  # type: ignore[arg-type]
        height = round(_WIDTH * cropped.height / cropped.width)
        small = cropped.resize((_WIDTH, height), Image.Resampling.LANCZOS)
        small.quantize(64, dither=Image.Dither.NONE).save(folder / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main()

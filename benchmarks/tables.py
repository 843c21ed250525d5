"""The figures in README.md and docs/*.md, written anew from the results.

    python -m benchmarks.tables

A block is the text between `<!-- NAME: python -m benchmarks.tables -->` and `<!-- end -->`. The
command replaces it by what `benchmarks.pages.blocks` makes from benchmarks/results, docs/study and
the package. Run it after each measurement; a test fails until the pages have the measured figures.
"""

from __future__ import annotations

import re

from benchmarks.pages.blocks import BLOCKS, documents

_BLOCK = re.compile(
    r"^<!-- (?P<name>[^\n]+): python -m benchmarks\.tables -->\n(?P<text>.*?)^<!-- end -->$",
    re.MULTILINE | re.DOTALL,
)


def block_names(text: str) -> list[str]:
    """Returns the names of the blocks in a page, in order."""
    return [match["name"] for match in _BLOCK.finditer(text)]


def without_blocks(text: str) -> str:
    """Returns a page without the text of its blocks."""
    return _BLOCK.sub("", text)


def rewrite(text: str) -> str:
    """Returns a page with its blocks made anew. Raises KeyError for an unknown block."""

    def replace(match: re.Match[str]) -> str:
        start = match[0].splitlines()[0]
        return f"{start}\n{BLOCKS[match['name']]()}<!-- end -->"

    return _BLOCK.sub(replace, text)


def main() -> None:
    """Rewrites the blocks of all pages; prints the pages that changed."""
    for path in documents():
        text = path.read_text(encoding="utf-8")
        if (new_text := rewrite(text)) != text:
            path.write_text(new_text, encoding="utf-8")
            print(f"{path.name}: new figures")


if __name__ == "__main__":
    main()

"""The links of README.md and docs: each leads to a file, and each anchor to a heading."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from conftest import ROOT

DOCUMENTS = sorted(ROOT.glob("*.md")) + sorted(ROOT.glob("docs/*.md"))
_CODE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)


def links(text: str) -> list[str]:
    """Returns the targets of a page's links and pictures."""
    return re.findall(r"\]\(([^)\s]+)\)", _CODE.sub("", text))


def anchors(page: Path) -> set[str]:
    """Returns the anchors of a page's headings, as GitHub and Sphinx make them."""
    text = _CODE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {
        re.sub(r"[^\w -]", "", heading.lower()).strip().replace(" ", "-") for heading in headings
    }


@pytest.mark.parametrize("page", DOCUMENTS, ids=lambda path: path.name)
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for link in links(page.read_text(encoding="utf-8")):
        if link.startswith("https://"):  # not http:
            continue
        path, _, anchor = link.partition("#")
        target = page.parent / path if path else page
        assert target.is_file(), link
        assert not anchor or anchor in anchors(target), link


def test_index_links_to_each_page_and_contains_it() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    pages = [path.name for path in ROOT.glob("docs/*.md") if path.name != "index.md"]
    linked = [link for link in links(index) if link.endswith(".md")]
    assert sorted(linked) == sorted(pages)
    tree = r"^```\{toctree\}\n:hidden:\n:caption: ([^\n]+)\n\n(.*?)^```$"
    groups = re.findall(tree, index, re.M | re.S)
    contained = [name for _, names in groups for name in names.split()]
    assert contained == [link.removesuffix(".md") for link in linked]
    assert [caption for caption, _ in groups] == re.findall(r"^## (.+)$", index, re.M)


def test_index_begins_like_the_readme() -> None:
    first = [
        (ROOT / name).read_text(encoding="utf-8").split("\n\n")[1]
        for name in ("README.md", "docs/index.md")
    ]
    assert first[0].replace("(docs/", "(") == first[1]

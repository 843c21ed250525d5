"""The report of a diagnosis: one HTML file that needs no other file."""

from __future__ import annotations

import base64
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from keras_pendulum.diagnosis.figure import FONT_SIZE
from keras_pendulum.errors import one_line
from keras_pendulum.figures.style import own_style, png

if TYPE_CHECKING:
    from keras_pendulum.diagnosis.diagnosis import Diagnosis
    from keras_pendulum.diagnosis.faults import Finding

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 46rem; padding: 1rem;
  overflow-wrap: break-word; color: #1a1a1a; background: #ffffff; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
img { max-width: 100%; height: auto; }
@media (prefers-color-scheme: dark) {
  body { color: #e6e6e6; background: #16181c; } img { border-radius: 6px; } }
a { color: inherit; } dt { font-weight: 600; } dd { margin: 0 0 0.5rem 0; }
"""


def as_html(diagnosis: Diagnosis) -> str:
    """Returns the report. Every text from outside, such as the agent's name, is escaped."""
    measurement = diagnosis.measurement
    name = _text(measurement.policy.name)
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>Diagnosis of {name}</title><style>{_STYLE}</style></head><body>",
        f"<h1>Diagnosis of {name}</h1>",
        f"<p><strong>{_text(diagnosis.verdict)}</strong></p>",
        f"<p>{_text(diagnosis.declared)}. The best possible mean return is "
        f"{measurement.optimum:.2f}.</p>",
        f'<img alt="Learned and exact values, repairs" src="{_image(diagnosis)}">',
    ]
    for number, finding in enumerate(diagnosis.findings, 1):
        parts += [f"<h2>{number}. {_text(finding.title)}</h2>", _section(finding)]
    for note in diagnosis.notes:
        parts += [f"<h2>Note, costs little: {_text(note.title)}</h2>", _section(note)]
    parts += [f"<p>{_text(sentence)}.</p>" for sentence in diagnosis.assumptions]
    parts += [f"<p>Not determined: {_text(limit)}.</p>" for limit in diagnosis.limits]
    return "\n".join([*parts, "</body></html>", ""])


def _section(finding: Finding) -> str:
    rows = {
        "Evidence": finding.evidence,
        "A healthy network": finding.healthy,
        "What it is": finding.explanation,
        "What to do": finding.remedy,
    }
    if finding.repair is not None:
        rows["Repair without training"] = str(finding.repair)
        rows["Cost in return"] = f"{finding.repair.won:.1f}"
    items = "".join(f"<dt>{_text(name)}</dt><dd>{_text(text)}</dd>" for name, text in rows.items())
    return f"<dl>{items}<dt>Read more</dt><dd>{_link(finding.page)}</dd></dl>"


def _link(page: str) -> str:
    """Returns a link to a page of the docs, or its name where this package is not a checkout."""
    name, _, section = page.partition("#")
    file = Path(__file__).parents[2] / name
    if not file.is_file():
        return _text(page)
    return f'<a href="{_text(file.as_uri())}#{_text(section)}">{_text(page)}</a>'


def _text(text: str) -> str:
    return escape(one_line(text))


def _image(diagnosis: Diagnosis) -> str:
    with own_style(FONT_SIZE):
        picture = png(diagnosis.figure(), dpi=90)
    return f"data:image/png;base64,{base64.b64encode(picture).decode()}"

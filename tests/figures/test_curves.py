from __future__ import annotations

from keras_pendulum.figures.curves import STYLES, curve_style


def test_24_curves_have_different_styles_and_neighbours_different_lines() -> None:
    styles = [curve_style(index) for index in range(24)]
    assert len({(color, line) for color, line, _ in styles}) == 24
    assert len({(color, marker) for color, _, marker in styles}) == 24
    assert styles[: len(STYLES)] == list(STYLES)

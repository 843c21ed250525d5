"""The styles of curves."""

from __future__ import annotations

from keras_pendulum.config.presets import PRESETS
from keras_pendulum.figures.curves import PRESET_STYLES, curve_style, curve_styles


def test_each_preset_has_a_colour_of_its_own_and_none_is_black() -> None:
    colours = [curve_style(PRESET_STYLES[name])[0] for name in PRESETS]
    assert len(set(colours)) == len(colours)
    assert "black" not in colours  # the optimum


def test_the_first_curve_of_a_preset_has_its_style_and_the_others_have_free_ones() -> None:
    names = ["mine", "swingup", None, "swingup", "reference"]
    styles = curve_styles(names)
    assert styles[1] == curve_style(PRESET_STYLES["swingup"])
    assert styles[4] == curve_style(PRESET_STYLES["reference"])
    assert len(set(styles)) == len(styles)

from __future__ import annotations

import re
from pathlib import Path

import pytest

import keras_pendulum as kp


def test_find_weights_returns_a_shipped_file_unless_the_current_folder_has_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "reference").mkdir()  # a folder of that name is ignored
    shipped = kp.find_weights("reference")
    assert shipped == kp.find_weights("reference.h5") == kp.find_weights(Path("reference"))
    metadata = kp.load_weights(shipped).metadata
    recorded = [metadata[name] for name in ("preset", "seed", "gravity")]
    assert recorded == ["reference", 0, 1.0]
    (tmp_path / "reference.h5").touch()
    assert kp.find_weights("reference.h5") == Path("reference.h5")
    with pytest.raises(kp.WeightsError, match="folder/reference: no such file"):
        kp.find_weights("folder/reference")
    (tmp_path / "folder").mkdir()
    with pytest.raises(kp.WeightsError, match=r"folder: a folder without a run; .* \(\.h5\)$"):
        kp.find_weights("folder")
    (tmp_path / "folder" / "mine.h5").touch()
    example = Path("folder", "mine.h5")
    with pytest.raises(
        kp.WeightsError,
        match=re.escape(
            f"folder: a folder without a run; expected a weights file (.h5), such as {example}"
        ),
    ):
        kp.find_weights("folder")
    (tmp_path / "folder" / "pendulum_weight.h5").touch()  # the folder of a run
    assert kp.find_weights("folder") == Path("folder", "pendulum_weight.h5")
    (tmp_path / "folder" / "cartpole_weight.h5").touch()
    with pytest.raises(kp.WeightsError, match="folder: a folder"):
        kp.find_weights("folder")


def test_load_weights_takes_a_path_or_a_shipped_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert kp.load_weights("cartpole").metadata["preset"] == "cartpole"
    kp.save_weights(kp.DQN((8,)), "cartpole")  # the user's own file comes first
    assert kp.load_weights("cartpole").hidden_units == (8,)
    for wrong in ("nonsense", "", "a\0b", "x" * 999):
        with pytest.raises(kp.WeightsError, match="weights file"):
            kp.load_weights(wrong)


def test_mistyped_name_gets_a_suggestion() -> None:
    with pytest.raises(kp.WeightsError, match=r"\(\.h5\); did you mean reference\?$"):
        kp.find_weights("refrence")

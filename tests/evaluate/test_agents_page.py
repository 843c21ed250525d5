"""The examples of docs/agents.md."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest
from conftest import ROOT

PAGE = (ROOT / "docs" / "agents.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda text: text.split("\n")[0])
def test_example_prints_a_regret(
    example: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    if "stable_baselines3" in example and not importlib.util.find_spec("stable_baselines3"):
        pytest.skip("Stable-Baselines3 is not installed")
    exec(compile(example, "docs/agents.md", "exec"), {})
    printed = capsys.readouterr().out
    found = re.search(r"Regret: ([\d.]+)", printed) or re.fullmatch(r"([\d.]+)\n", printed)
    assert found is not None
    regret = float(found.group(1))
    is_perfect = regret == 0 and "CartPole-v1" in example  # its pole never falls
    assert 0 < regret < 3000 or is_perfect
    assert ("Regret from learning" in printed) == ("discount=" in example or "SAC" in example)


def test_page_has_an_example_for_each_library() -> None:
    words = ("keras.Sequential", "torch.nn", "tf.function", "stable_baselines3", "def ")
    assert [word for word in words if not any(word in example for example in EXAMPLES)] == []

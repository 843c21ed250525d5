from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
from pathlib import Path

import pytest

from keras_pendulum.backend import give_back_freed_memory, quick_import

CODE = "import os, keras_pendulum; print(os.environ['TF_NUM_INTRAOP_THREADS'])"


def threads(**environment: str) -> str:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("TF_")}
    return subprocess.check_output(
        [sys.executable, "-c", CODE], env=clean | environment, text=True
    ).strip()


def test_tensorflow_is_asked_for_one_thread_unless_the_user_has_chosen() -> None:
    assert threads() == "1"
    assert threads(TF_NUM_INTRAOP_THREADS="2") == "2"


def test_a_quick_import_leaves_the_garbage_collector_on() -> None:
    with quick_import():
        assert not gc.isenabled()
    assert gc.isenabled()


def run(code: str, *arguments: Path) -> None:
    environment = os.environ | {"MPLBACKEND": "agg"}
    subprocess.run([sys.executable, "-c", code, *arguments], env=environment, check=True)


@pytest.mark.parametrize(
    "afterwards",
    [
        "assert not {'matplotlib.patches', 'matplotlib.pyplot'} & set(sys.modules)",
        "keras.visualization.plot_image_gallery(np.ones((4, 8, 8, 3)), path=sys.argv[1], cols=2)\n"
        "assert open(sys.argv[1], 'rb').read(4) == b'\\x89PNG'",
        "from keras.src.visualization.plot_bounding_box_gallery import patches\n"
        "from matplotlib.patches import Patch\n"
        "assert patches.Patch is Patch",
        "import matplotlib.pyplot\n"
        "assert matplotlib.pyplot is sys.modules['matplotlib.pyplot']\n"
        "assert matplotlib.pyplot.figure() and matplotlib.patches.Patch()",
    ],
)
def test_keras_comes_without_pyplot_and_gets_it_when_used(afterwards: str, tmp_path: Path) -> None:
    imports = "import sys, numpy as np, keras_pendulum\nkeras_pendulum.DQN\nimport keras\n"
    run(imports + afterwards, tmp_path / "picture.png")


@pytest.mark.parametrize(
    "use",
    [
        "from matplotlib.figure import Figure; Figure().subplots()",
        "import matplotlib.ticker; matplotlib.ticker.NullLocator()",
        "import matplotlib.pyplot as plt; plt.figure()",
    ],
)
def test_what_is_imported_with_keras_can_use_matplotlib_at_once(use: str) -> None:
    run(
        "from keras_pendulum.backend import quick_import\n"
        f"with quick_import():\n    import matplotlib.pyplot\n    {use}\n{use}"
    )


def test_a_matplotlib_in_use_stays() -> None:
    run(
        "import sys, matplotlib.pyplot as plt, keras_pendulum\nkeras_pendulum.DQN\n"
        "assert sys.modules['matplotlib.pyplot'] is plt"
    )


def test_a_c_library_that_keeps_freed_memory_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    give_back_freed_memory()
    monkeypatch.setattr(ctypes, "CDLL", lambda name: object())
    give_back_freed_memory()

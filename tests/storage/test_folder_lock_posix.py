"""The holder of a lock notices when its folder moves; Windows moves no folder with an open file."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

import keras_pendulum as kp
from keras_pendulum.storage.folder_lock import LOCK_FILE, lock_folder

if sys.platform == "win32":
    pytest.skip("Windows moves and removes no open file", allow_module_level=True)


@pytest.mark.parametrize("change", ["moved", "replaced", "removed", "removed and made again"])
def test_moved_folder_is_refused(change: str, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    with lock_folder(folder) as require_not_moved:
        require_not_moved()
        if change.startswith("removed"):
            shutil.rmtree(folder)
        else:
            folder.rename(tmp_path / "moved")
        if change in ("replaced", "removed and made again"):
            folder.mkdir()
            (folder / LOCK_FILE).touch()
        with pytest.raises(kp.UserError, match=f"^{folder}, or .* was moved, .*: nothing more is"):
            require_not_moved()
    # The lock file of another run is not removed.
    assert (folder / LOCK_FILE).exists() == (change in ("replaced", "removed and made again"))


def test_removed_lock_file_is_refused_because_another_run_could_start(tmp_path: Path) -> None:
    with lock_folder(tmp_path) as require_not_moved:
        (tmp_path / LOCK_FILE).unlink()
        with lock_folder(tmp_path), pytest.raises(kp.UserError, match=r"the file \.lock in it"):
            require_not_moved()


def test_link_in_place_of_the_lock_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / LOCK_FILE).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(kp.UserError, match=r"^cannot write .*\.lock: "), lock_folder(tmp_path):
        pass
    assert not (tmp_path / "elsewhere").exists()

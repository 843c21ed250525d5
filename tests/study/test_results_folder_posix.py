"""The folder of a study, moved during the study."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from test_results_folder import reply, result_files

from keras_pendulum.errors import UserError
from keras_pendulum.study.arms import own_arms
from keras_pendulum.study.results_folder import ResultsFolder

if sys.platform == "win32":
    pytest.skip("needs links and moved folders", allow_module_level=True)


def test_no_result_is_written_into_another_folder_at_the_same_path(tmp_path: Path) -> None:
    target, link = tmp_path / "study", tmp_path / "link"
    target.mkdir()
    link.symlink_to(target)
    folder = ResultsFolder(link, own_arms(["reference"], []), 2)
    with folder.create_and_lock():
        first, second = folder.jobs()
        link.unlink()
        link.symlink_to(tmp_path)
        folder.save(first, reply(first))
        assert len(result_files(target)) == 1
        target.rename(tmp_path / "moved")
        shutil.copytree(tmp_path / "moved", target)
        with pytest.raises(UserError, match=r"study, or the file .lock in it, was moved"):
            folder.save(second, reply(second))
    assert len(result_files(target)) == 1

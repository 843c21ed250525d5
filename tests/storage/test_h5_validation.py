"""Hostile files, made to cost time or memory or to read other files, are refused."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from conftest import command_line

import keras_pendulum as kp
from keras_pendulum.train.checkpoint import load_config

KERNEL = {"keras 2": "dense/dense/kernel:0", "keras 3": "hidden/dense/vars/0"}
Change = Callable[[h5py.File, str], None]


def replace_kernel(make: Change) -> Change:
    """Returns a change that calls `make` in place of a kernel."""

    def change(file: h5py.File, kernel: str) -> None:
        del file[kernel]
        make(file, kernel)

    return change


def chunked(file: h5py.File, name: str) -> None:
    """Declares 1 GiB that takes a few kilobytes in the file."""
    file.create_dataset(name, (2**14, 2**14), "f4", chunks=(2**11, 2**11), compression="gzip")


def one_chunk(file: h5py.File, name: str) -> None:
    """Stores all its data, but an array in chunks could also lack some."""
    file.create_dataset(name, data=np.zeros((3, 16), np.float32), chunks=(3, 16))


def strings(file: h5py.File, name: str) -> None:
    file.create_dataset(name, data=["a"] * 4, dtype=h5py.string_dtype())


def reference(file: h5py.File, name: str) -> None:
    file.create_dataset(name, data=[file.ref] * 4, dtype=h5py.ref_dtype)


def compound(file: h5py.File, name: str) -> None:
    file.create_dataset(name, data=np.zeros(4, [("a", "f4"), ("b", "f4")]))


def virtual(file: h5py.File, name: str) -> None:
    layout = h5py.VirtualLayout((3, 16), np.float32)
    layout[:] = h5py.VirtualSource("elsewhere.h5", "data", (3, 16))
    file.create_virtual_dataset(name, layout)


def external(file: h5py.File, name: str) -> None:
    file.create_dataset(name, (3, 16), "f4", external=[("/etc/hostname", 0, 192)])


def unwritten(file: h5py.File, name: str) -> None:
    file.create_dataset(name, (2**14, 2**14), "f4")


def same_array_again_and_again(file: h5py.File, kernel: str) -> None:
    for i in range(900):
        file[f"again_{i}"] = file[kernel]


def circle(file: h5py.File, kernel: str) -> None:
    group = file.create_group("circle")
    group["inside"] = group


def deep(file: h5py.File, kernel: str) -> None:
    file.create_group("/".join("deep" for _ in range(40)))


def many_names(file: h5py.File, kernel: str) -> None:
    for i in range(3000):
        file[f"name_{i}"] = h5py.SoftLink("/nowhere")


def many_in_groups(file: h5py.File, kernel: str) -> None:
    for i in range(60):
        group = file.create_group(f"group_{i}")
        for k in range(60):
            group.create_group(str(k))


def many_attributes(file: h5py.File, kernel: str) -> None:
    for i in range(100):
        file.attrs[f"attribute_{i}"] = i


def put(name: str, value: Any) -> Change:
    return lambda file, kernel: file.__setitem__(name, value)


HOSTILE: dict[str, tuple[Change, str]] = {
    "soft link": (
        replace_kernel(lambda file, name: file.__setitem__(name, h5py.SoftLink("/"))),
        "holds a link",
    ),
    "external link": (
        replace_kernel(
            lambda file, name: file.__setitem__(name, h5py.ExternalLink("other.h5", "/x"))
        ),
        "holds a link",
    ),
    "link anywhere": (put("aside", h5py.SoftLink("/nowhere")), "holds a link"),
    "external storage": (replace_kernel(external), "not a plain array"),
    "virtual": (replace_kernel(virtual), "not a plain array"),
    "compressed bomb": (replace_kernel(chunked), "not a plain array"),
    "in chunks": (replace_kernel(one_chunk), "not a plain array"),
    "declared but not stored": (replace_kernel(unwritten), "not a plain array"),
    "strings": (replace_kernel(strings), "not a plain array"),
    "references": (replace_kernel(reference), "not a plain array"),
    "compound": (replace_kernel(compound), "not a plain array"),
    "type in place of an array": (put("type", np.dtype("f4")), "neither a group nor an array"),
    "arrays that share their bytes": (same_array_again_and_again, "declare"),
    "circle": (circle, "nested in more than"),
    "deep": (deep, "nested in more than"),
    "many names": (many_names, "entries"),
    "many groups in groups": (many_in_groups, "holds more than"),
    "many attributes": (many_attributes, "attributes"),
    "huge attribute": (
        lambda file, kernel: file.create_group("new").attrs.create("huge", np.zeros(2**20)),
        "huge attribute",
    ),
    "reference attribute": (
        lambda file, kernel: file.attrs.create("ref", file.ref, dtype=h5py.ref_dtype),
        "of no plain type",
    ),
}


def hostile_file(path: Path, change: Change, layout: str) -> Path:
    """Writes a valid file of `layout` and changes it."""
    network = kp.DQN((16, 8), 5)
    if layout == "keras 2":
        kp.save_weights(network, path)
    else:
        network.save_weights(path.with_suffix(".weights.h5"))
        path.with_suffix(".weights.h5").rename(path)
    assert kp.load_weights(path).hidden_units == (16, 8)
    # Only the newest format allows huge attributes.
    with h5py.File(path, "r+", libver="latest") as file:
        change(file, KERNEL[layout])
    return path


@pytest.mark.parametrize("layout", KERNEL)
@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_file_is_refused_in_one_line_before_an_array_is_read(
    kind: str, layout: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    change, message = HOSTILE[kind]
    path = hostile_file(tmp_path / "hostile.h5", change, layout)

    def read(*parts: object) -> None:
        raise AssertionError("an array was read")

    monkeypatch.setattr(h5py.Dataset, "__getitem__", read)
    for load in (kp.load_weights, load_config):
        with pytest.raises(kp.WeightsError) as caught:
            load(path)
        assert message in str(caught.value)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_large_file_with_variable_length_strings_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kp.DQN((16, 8), 5).save_weights(tmp_path / "a.weights.h5")
    monkeypatch.setattr("keras_pendulum.storage.h5_validation._LARGEST_FILE_WITH_STRINGS", 1000)
    with pytest.raises(kp.WeightsError, match="string of variable length"):
        kp.load_weights(tmp_path / "a.weights.h5")
    kp.save_weights(kp.DQN((16, 8), 5), tmp_path / "fixed.h5")
    kp.load_weights(tmp_path / "fixed.h5")


def test_file_above_the_size_limit_is_refused_unread(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.h5"
    kp.save_weights(kp.DQN((16, 8), 5), path)
    size = path.stat().st_size
    monkeypatch.setattr("keras_pendulum.storage.keras_h5.LARGEST_FILE", size)
    kp.load_weights(path)
    monkeypatch.setattr("keras_pendulum.storage.keras_h5.LARGEST_FILE", size - 1)

    def read(*parts: object) -> None:
        raise AssertionError("the file was read")

    monkeypatch.setattr("keras_pendulum.storage.checksum.verify", read)
    with pytest.raises(kp.WeightsError, match="larger than 1 GiB"):
        kp.load_weights(path)


@pytest.mark.slow
def test_random_damage_is_refused_or_loads_finite_weights() -> None:
    # In another process, because HDF5's library may crash it.
    words = [sys.executable, str(Path(__file__).parent / "fuzz_files.py"), "0", "300"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    refused, loaded = (int(part.split()[0]) for part in reversed(done.stdout.split(", ")))
    assert refused + loaded == 300
    assert refused > 50


def test_endless_heap_of_strings_is_refused(tmp_path: Path) -> None:
    """HDF5 itself reads such a heap in an endless loop (found by fuzz_files.py)."""
    path = tmp_path / "a.weights.h5"
    kp.DQN((16, 8), 5).save_weights(path)
    content = bytearray(path.read_bytes())
    heap = content.index(b"GCOL")
    content[heap + 16 : heap + 32] = bytes(16)  # the first object: number 0, size 0
    path.write_bytes(content)
    # In another process, which the timeout can stop.
    words = command_line("evaluate", path)
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "its strings cannot be read" in done.stderr


@pytest.mark.parametrize("declared", [2**32 - 1, 2**31, 100_000])
def test_string_that_declares_a_huge_length_is_refused(declared: int, tmp_path: Path) -> None:
    path = tmp_path / "a.weights.h5"
    kp.DQN((16, 8), 5).save_weights(path)
    content = path.read_bytes()
    heap = content.index(b"GCOL").to_bytes(8, "little")
    # An attribute refers to a string by its length and the address of the heap.
    changed, count = re.subn(
        rb"[\x01-\x20]\0\0\0(?=" + re.escape(heap) + rb")",
        lambda match: declared.to_bytes(4, "little"),
        content,
    )
    assert count >= 3
    path.write_bytes(changed)
    with pytest.raises(kp.WeightsError, match=r"/\S+ has damaged or huge strings"):
        kp.load_weights(path)

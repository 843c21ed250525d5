"""The layers of a feed-forward network inside an HDF5 file: found, checked, read, written.

Keras loads a wrong file half-way, or silently wrong. Here a file is opened only when its digest is
right (`integrity`) and it holds nothing but plain arrays (`structure`), and its layers are taken
only when they are float, of a believable size, finite, and a chain in which each takes what the
one before gives.
"""

from __future__ import annotations

import contextlib
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from h5py import h5f
from numpy.typing import ArrayLike, NDArray

from keras_pendulum import integrity, structure
from keras_pendulum.config import LARGEST_FILE
from keras_pendulum.errors import UserError, WeightsError
from keras_pendulum.hdf5_writer import add_arrays, add_attributes, add_group

_LARGEST_LAYER = 8192  # units
_Layer = tuple[str, list[Any]]  # its name and its datasets, kernel and bias


@contextlib.contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """The HDF5 file at `path`, open for reading.

    Raises:
        WeightsError: missing, a folder, empty, not HDF5, of a structure no network needs,
            truncated or otherwise damaged, also where the damage shows only inside the `with`
            block.
    """
    file = Path(path)
    try:
        if not file.exists():
            raise WeightsError(f"{path}: no such file; expected a weights file (.h5)")
        if not file.is_file():
            raise WeightsError(f"{path}: not a file; expected a weights file (.h5)")
        with open(file, "rb") as stream:
            head = stream.read(8)
            if not head:
                raise WeightsError(f"{path}: the file is empty; expected a weights file (.h5)")
            if head != b"\x89HDF\r\n\x1a\n":
                raise WeightsError(f"{path}: not an HDF5 file; expected a weights file (.h5)")
            if file.stat().st_size > LARGEST_FILE:
                raise WeightsError(f"{path}: larger than 1 GiB; no network here is")
            stream.seek(0)
            integrity.verify(stream, path)
            structure.check_heaps(stream, path)
    except OSError as error:
        raise WeightsError(f"{path}: cannot be read ({error.strerror})") from error
    with damage_told(path), h5py.File(file, "r") as content:
        structure.check(content, path)
        yield content


@contextlib.contextmanager
def damage_told(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raises WeightsError where what is read of a file, or made of that, turns out to be wrong."""
    try:
        yield
    except UserError:
        raise
    # Damage shows as whatever h5py's C library or the first use of a wrong value meets.
    except (
        *(OSError, RuntimeError, LookupError, ValueError, TypeError),
        *(AttributeError, ArithmeticError),
    ) as error:
        reason = re.sub(r"\s+", " ", str(error)).strip()
        raise WeightsError(f"{path}: cannot be read, the file is damaged ({reason})") from error


def read_layers(
    file: h5py.File, path: str | os.PathLike[str], inputs: int
) -> list[NDArray[np.float32]]:
    """Kernel [in, out] and bias [out] of each layer, in order from the first, with `inputs`, on.

    Raises:
        WeightsError: there are none, or they are not those of a chain of Dense layers.
    """
    root = file.get("model_weights", file)  # a whole Keras 2 model keeps its weights one deeper
    named = _keras2_layers(root) if "layer_names" in root.attrs else _keras3_layers(root, inputs)
    if not named:
        raise WeightsError(f"{path}: holds no network weights in a layout of Keras 2 or Keras 3")
    arrays: list[NDArray[np.float32]] = []
    width = inputs
    for name, datasets in named:
        if len(datasets) != 2:
            raise WeightsError(
                f"{path}: layer {name} has {len(datasets)} arrays; expected kernel and bias"
            )
        kernel, bias = (read_array(dataset, path) for dataset in datasets)
        if kernel.dtype.kind != "f" or bias.dtype.kind != "f":
            raise WeightsError(
                f"{path}: layer {name} is of {kernel.dtype}; expected floating-point"
            )
        if kernel.ndim != 2 or bias.shape != kernel.shape[1:]:
            raise WeightsError(
                f"{path}: layer {name} has shapes {kernel.shape} and {bias.shape}; "
                "expected a kernel [in, out] and a bias [out]"
            )
        if not 1 <= kernel.shape[1] <= _LARGEST_LAYER:
            raise WeightsError(
                f"{path}: layer {name} has {kernel.shape[1]} units; expected 1 to {_LARGEST_LAYER}"
            )
        if kernel.shape[0] != width:
            raise WeightsError(
                f"{path}: layer {name} takes {kernel.shape[0]} inputs; expected {width}, as many "
                "as there are before it"
            )
        width = kernel.shape[1]
        arrays += [kernel.astype(np.float32), bias.astype(np.float32)]
    return arrays


def read_array(dataset: Any, path: str | os.PathLike[str], *, finite: bool = True) -> NDArray[Any]:
    """The numbers of a dataset in a file that `opened` has let through.

    Raises:
        WeightsError: it is a group, or holds a NaN or infinity where all must be `finite`.
    """
    if not isinstance(dataset, h5py.Dataset):
        raise WeightsError(f"{path}: {dataset.name} is not an array")
    array: NDArray[Any] = dataset[()]
    with np.errstate(over="ignore"):  # what float32 cannot hold is infinite to a network
        if finite and not np.isfinite(array.astype(np.float32)).all():
            raise WeightsError(f"{path}: {dataset.name} holds NaN or infinite numbers")
    return array


def write_layers(file: h5f.FileID, arrays: list[NDArray[np.float32]]) -> None:
    """Writes kernel, bias, kernel, bias, … in the layout of Keras 2's `save_weights`."""
    names = ["dense" if i == 0 else f"dense_{i}" for i in range(len(arrays) // 2)]
    about: dict[str, ArrayLike] = {
        "backend": b"tensorflow",
        "keras_version": b"2.15.0",  # the version whose layout this is
        "layer_names": np.array(names, "S"),
    }
    add_attributes(file, about)
    for name, kernel, bias in zip(names, arrays[::2], arrays[1::2], strict=True):
        layer = add_group(file, name)
        parts = np.array([f"{name}/kernel:0", f"{name}/bias:0"], "S")
        add_attributes(layer, {"weight_names": parts})
        add_arrays(add_group(layer, name), {"kernel:0": kernel, "bias:0": bias})
    nothing = np.array([], "S1")
    add_attributes(add_group(file, "top_level_model_weights"), {"weight_names": nothing})


def _keras2_layers(root: h5py.Group) -> list[_Layer]:
    """Layers with weights, in the file's own order."""
    layers = []
    for name in map(text, root.attrs["layer_names"]):
        group = root[name]
        datasets = [group[text(part)] for part in group.attrs["weight_names"]]
        if datasets:  # Flatten, Dropout and the like have none
            layers.append((name, datasets))
    return layers


def _keras3_layers(root: h5py.Group, inputs: int) -> list[_Layer]:
    """Layers with weights, put in order: the file keeps them by attribute name instead."""
    layers: dict[str, _Layer] = {}

    def collect(path: str, entry: Any) -> None:
        *parents, last = path.split("/")
        if last == "vars" and parents[:1] != ["optimizer"] and len(entry):
            # The layer's own name, dense_3, counts the layers as they were made.
            name = text(entry.attrs.get("name", "/".join(parents)))
            layers[path] = (name, [entry[key] for key in sorted(entry, key=_natural)])

    root.visititems(collect)
    by_number = sorted(layers.values(), key=lambda layer: _natural(layer[0]))
    if len({re.sub(r"\d*$", "", name).rstrip("_") for name, _ in by_number}) == 1:
        return by_number
    return _ordered_by_width(by_number, inputs)


def _ordered_by_width(layers: list[_Layer], inputs: int) -> list[_Layer]:
    """The layers in the one order in which each takes as many inputs as the last one gives."""
    ordered: list[_Layer] = []
    remaining = list(layers)
    shape: tuple[int, ...] = (inputs,)
    while remaining:
        following = [layer for layer in remaining if layer[1][0].shape[:1] == shape[-1:]]
        if len(following) != 1:
            raise ValueError(f"the order of its layers {[name for name, _ in layers]} is unclear")
        ordered += following
        remaining.remove(following[0])
        shape = following[0][1][0].shape
    return ordered


def _natural(name: str) -> list[tuple[int, str]]:
    """Sort key by which dense_2 comes before dense_10, and dense before both."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def text(name: Any) -> str:
    """An HDF5 text as Python's, however it is stored."""
    return name.decode() if isinstance(name, bytes) else str(name)

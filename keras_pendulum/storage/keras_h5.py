"""Reads and writes the layers of a feed-forward network in an HDF5 file.

Keras loads some wrong files in part, and others without an error. Here a file is opened only when
its SHA-256 matches (`checksum`) and when it holds nothing but plain arrays (`h5_validation`). Its
layers are returned only when they are finite floating-point numbers, of a plausible size, and when
each layer has as many inputs as the previous one has outputs.
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

from keras_pendulum.config.config import LARGEST_FILE
from keras_pendulum.errors import UserError, WeightsError
from keras_pendulum.storage import checksum, h5_validation
from keras_pendulum.storage.hdf5_writer import add_arrays, add_attributes, add_group

_LARGEST_LAYER = 8192  # units
_Layer = tuple[str, list[Any]]  # name and datasets, kernel and bias


@contextlib.contextmanager
def open_h5(path: str | os.PathLike[str]) -> Iterator[h5py.File]:
    """Opens the HDF5 file at `path` for reading.

    Raises WeightsError when the file is missing, a folder, empty, not HDF5, or holds more than
    plain arrays; and for damage, also where it is found inside the `with` block.
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
                raise WeightsError(f"{path}: larger than 1 GiB, the limit of a weights file")
            stream.seek(0)
            checksum.verify(stream, path)
            h5_validation.check_heaps(stream, path)
    except OSError as error:
        raise WeightsError(f"{path}: cannot be read ({error.strerror})") from error
    with report_damage(path), h5py.File(file, "r") as content:
        h5_validation.check(content, path)
        yield content


@contextlib.contextmanager
def report_damage(path: str | os.PathLike[str]) -> Iterator[None]:
    """Raises WeightsError for an error in the `with` block, which uses the values of a file."""
    try:
        yield
    except UserError:
        raise
    # Damage causes any error of h5py's C library or of the code that uses a wrong value.
    except (
        *(OSError, RuntimeError, LookupError, ValueError, TypeError),
        *(AttributeError, ArithmeticError),
    ) as error:
        reason = re.sub(r"\s+", " ", str(error)).strip()
        raise WeightsError(f"{path}: cannot be read, the file is damaged ({reason})") from error


def read_layers(
    file: h5py.File, path: str | os.PathLike[str], input_size: int
) -> list[NDArray[np.float32]]:
    """Returns kernel [in, out] and bias [out] of each layer; the first has `input_size` inputs.

    Raises WeightsError when the file holds no layers, or others than a chain of Dense layers.
    """
    root = file.get("model_weights", file)  # the group of a whole Keras 2 model
    if "layer_names" in root.attrs:
        layers = _keras2_layers(root)
    else:
        layers = _keras3_layers(root, input_size)
    if not layers:
        raise WeightsError(f"{path}: holds no network weights in a layout of Keras 2 or Keras 3")
    arrays: list[NDArray[np.float32]] = []
    width = input_size
    for name, datasets in layers:
        if len(datasets) != 2:
            raise WeightsError(
                f"{path}: layer {name} has {len(datasets)} arrays; expected kernel and bias"
            )
        kernel, bias = (read_array(dataset, path) for dataset in datasets)
        if kernel.dtype.kind != "f" or bias.dtype.kind != "f":
            raise WeightsError(
                f"{path}: layer {name} has the type {kernel.dtype}; expected floating-point"
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
                f"{path}: layer {name} has {kernel.shape[0]} inputs; expected {width}, the size of "
                f"{'the previous layer' if arrays else 'an observation'}"
            )
        width = kernel.shape[1]
        arrays += [kernel.astype(np.float32), bias.astype(np.float32)]
    return arrays


def read_array(dataset: Any, path: str | os.PathLike[str], *, finite: bool = True) -> NDArray[Any]:
    """Returns the numbers of a dataset in a file that `open_h5` has checked.

    Raises WeightsError for a group, and with `finite` for a NaN or infinite number.
    """
    if not isinstance(dataset, h5py.Dataset):
        raise WeightsError(f"{path}: {dataset.name} is not an array")
    array: NDArray[Any] = dataset[()]
    with np.errstate(over="ignore"):  # a number too large for float32 becomes infinite
        if finite and not np.isfinite(array.astype(np.float32)).all():
            raise WeightsError(f"{path}: {dataset.name} holds NaN or infinite numbers")
    return array


def write_layers(file: h5f.FileID, arrays: list[NDArray[np.float32]]) -> None:
    """Writes kernel, bias, kernel, bias, … in the layout of Keras 2's `save_weights`."""
    names = ["dense" if i == 0 else f"dense_{i}" for i in range(len(arrays) // 2)]
    attributes: dict[str, ArrayLike] = {
        "backend": b"tensorflow",
        "keras_version": b"2.15.0",  # the version whose layout this is
        "layer_names": np.array(names, "S"),
    }
    add_attributes(file, attributes)
    for name, kernel, bias in zip(names, arrays[::2], arrays[1::2], strict=True):
        layer = add_group(file, name)
        weight_names = np.array([f"{name}/kernel:0", f"{name}/bias:0"], "S")
        add_attributes(layer, {"weight_names": weight_names})
        add_arrays(add_group(layer, name), {"kernel:0": kernel, "bias:0": bias})
    no_names = np.array([], "S1")
    add_attributes(add_group(file, "top_level_model_weights"), {"weight_names": no_names})


def _keras2_layers(root: h5py.Group) -> list[_Layer]:
    """Returns the layers with weights, in the order that the file records."""
    layers = []
    for name in map(decode, root.attrs["layer_names"]):
        group = root[name]
        datasets = [group[decode(weight)] for weight in group.attrs["weight_names"]]
        if datasets:  # Flatten, Dropout and the like have none
            layers.append((name, datasets))
    return layers


def _keras3_layers(root: h5py.Group, input_size: int) -> list[_Layer]:
    """Returns the layers with weights in their order, which the file does not record."""
    layers: dict[str, _Layer] = {}

    def collect(path: str, entry: Any) -> None:
        *parents, last = path.split("/")
        if last == "vars" and parents[:1] != ["optimizer"] and len(entry):
            # Keras numbers the names, such as dense_3, in the order of the layers' creation.
            name = decode(entry.attrs.get("name", "/".join(parents)))
            layers[path] = (name, [entry[key] for key in sorted(entry, key=_numeric_order)])

    root.visititems(collect)
    by_number = sorted(layers.values(), key=lambda layer: _numeric_order(layer[0]))
    if len({re.sub(r"\d*$", "", name).rstrip("_") for name, _ in by_number}) == 1:
        return by_number
    return _ordered_by_width(by_number, input_size)


def _ordered_by_width(layers: list[_Layer], input_size: int) -> list[_Layer]:
    """Returns the layers in the order in which inputs fit outputs; ValueError if not unique."""
    ordered: list[_Layer] = []
    remaining = list(layers)
    shape: tuple[int, ...] = (input_size,)
    while remaining:
        candidates = [layer for layer in remaining if layer[1][0].shape[:1] == shape[-1:]]
        if len(candidates) != 1:
            raise ValueError(f"the order of its layers {[name for name, _ in layers]} is unclear")
        ordered += candidates
        remaining.remove(candidates[0])
        shape = candidates[0][1][0].shape
    return ordered


def _numeric_order(name: str) -> list[tuple[int, str]]:
    """Returns a sort key that puts dense_2 before dense_10, and dense before both."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def decode(string: Any) -> str:
    """Returns a string of an HDF5 file as str, also one that h5py returns as bytes."""
    return string.decode() if isinstance(string, bytes) else str(string)

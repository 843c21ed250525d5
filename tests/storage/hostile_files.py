"""Writes files that were made to crash a reader, or to cost it time or memory.

Each is a sound file of one layout with one change. `write` returns its path.
"""

from __future__ import annotations

import functools
import json
import re
import struct
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import keras
import numpy as np

import keras_pendulum as kp
from keras_pendulum.storage.save_weights import encode_weights

KERNEL = {
    "this package": "dense/dense/kernel:0",
    "whole model": "model_weights/one/sequential/one/kernel",
    "Keras 3": "layers/dense/vars/0",
}
LAYOUTS = (*KERNEL, "keras")  # the last one is the zip file `.keras`
Change = Callable[[Path, str], None]  # changes the file of a layout
Members = dict[str, bytes]  # of a zip file


def network(one: int, two: int) -> Any:
    """Returns a Sequential with so many hidden units, which Keras 3 saves in three layouts."""
    model = keras.Sequential(
        [
            keras.Input((3,)),
            keras.layers.Dense(one, "tanh", name="one"),
            keras.layers.Dense(two, "tanh", name="two"),
            keras.layers.Dense(5, name="three"),
        ],
        name="sequential",
    )
    random = np.random.default_rng(0)
    model.set_weights([random.normal(size=each.shape) for each in model.get_weights()])
    return model


def write_sound(layout: str, folder: Path) -> Path:
    """Writes a file of a layout that loads, without a checksum; returns its path."""
    folder.mkdir(exist_ok=True)
    path = folder / ("a.keras" if layout == "keras" else "a.h5")
    path.write_bytes(_sound(layout))
    return path


@functools.cache
def _sound(layout: str, hidden_units: tuple[int, int] = (16, 8)) -> bytes:
    if layout == "this package":
        return encode_weights(kp.DQN(hidden_units, 5))  # with a checksum no change would be read
    model = network(*hidden_units)
    with tempfile.TemporaryDirectory() as folder:
        suffix = {"whole model": ".h5", "Keras 3": ".weights.h5", "keras": ".keras"}[layout]
        path = Path(folder, f"a{suffix}")
        (model.save_weights if layout == "Keras 3" else model.save)(path)
        return path.read_bytes()


# Changes by h5py: of the kernel's array, or beside it.


def opened(change: Callable[[h5py.File, str], None]) -> Change:
    """Returns a change of the open file, given the name of a kernel."""

    def change_file(path: Path, layout: str) -> None:
        # Only the newest format allows huge attributes.
        with h5py.File(path, "r+", libver="latest") as file:
            change(file, KERNEL[layout])

    return change_file


def kernel(make: Callable[[h5py.File, str, Any], None]) -> Change:
    """Returns a change that calls `make` in place of a kernel, with the kernel's array."""

    def change(file: h5py.File, name: str) -> None:
        array = file[name][()]
        del file[name]
        make(file, name, array)

    return opened(change)


def dataset(*arguments: Any, **options: Any) -> Change:
    """Returns a change that puts another array in place of a kernel."""
    return kernel(lambda file, name, array: file.create_dataset(name, *arguments, **options))


def in_place(value: Any) -> Change:
    """Returns a change that puts a link or a type in place of a kernel."""
    return kernel(lambda file, name, array: file.__setitem__(name, value))


def beside(name: str, value: Any) -> Change:
    """Returns a change that adds a link or a type."""
    return opened(lambda file, _: file.__setitem__(name, value))


def virtual(file: h5py.File, name: str, array: Any) -> None:
    layout = h5py.VirtualLayout(array.shape, np.float32)
    layout[:] = h5py.VirtualSource("elsewhere.h5", "data", array.shape)
    file.create_virtual_dataset(name, layout)


def same_array_again_and_again(file: h5py.File, name: str) -> None:
    for i in range(900):
        file[f"again_{i}"] = file[name]


def circle(file: h5py.File, name: str) -> None:
    group = file.create_group("circle")
    group["inside"] = group


def many_names(file: h5py.File, name: str) -> None:
    group = file.create_group("names")
    for i in range(30_000):
        group[str(i)] = h5py.SoftLink("/nowhere")


def many_in_groups(file: h5py.File, name: str) -> None:
    for i in range(60):
        group = file.create_group(f"group_{i}")
        for k in range(60):
            group.create_group(str(k))


def many_attributes(file: h5py.File, name: str) -> None:
    for i in range(100):
        file.attrs[f"attribute_{i}"] = i


def many_links_to_attributes(file: h5py.File, name: str) -> None:
    """Links 990 times to a group whose attributes hold 4 MB."""
    group = file.create_group("attributes")
    for i in range(64):
        group.attrs[str(i)] = np.zeros(60_000, np.uint8)
    for i in range(990):
        file[f"again_{i}"] = group


def overlapping_heaps(file: h5py.File, name: str) -> None:
    """Adds 100 000 heads of heaps, each of which spans all objects behind it."""
    head = b"GCOL\x01\0\0\0" + struct.pack("<Q", 2**40)
    item = struct.pack("<HHIQ", 1, 1, 0, 16)  # spans the next head
    file["heaps"] = np.frombuffer((head + item) * 100_000, np.uint8)


def sparse_array(file: h5py.File, name: str) -> None:
    """Adds an array of 200 MB that takes no space on the disk."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
    space = h5py.h5s.create_simple((200_000_000,))
    h5py.h5d.create(file.id, b"sparse", h5py.h5t.STD_U8LE, space, properties)


BY_H5PY: dict[str, Change] = {
    "a soft link": in_place(h5py.SoftLink("/")),
    "a link to itself": kernel(
        lambda file, name, array: file.__setitem__(name, h5py.SoftLink("/" + name))
    ),
    "an external link": in_place(h5py.ExternalLink("other.h5", "/x")),
    "a link beside the layers": beside("aside", h5py.SoftLink("/nowhere")),
    "data in another file": kernel(
        lambda file, name, array: file.create_dataset(
            name, array.shape, "f4", external=[("/etc/passwd", 0, array.nbytes)]
        )
    ),
    "a virtual array": kernel(virtual),
    "a compressed array of 1 GiB": dataset(
        (2**14, 2**14), "f4", chunks=(2**11, 2**11), compression="gzip"
    ),
    "an array in chunks": kernel(
        lambda file, name, array: file.create_dataset(name, data=array, chunks=array.shape)
    ),
    "an array of 1 GiB that is not stored": dataset((2**14, 2**14), "f4"),
    "strings": dataset(data=["a"] * 4, dtype=h5py.string_dtype()),
    "references": kernel(
        lambda file, name, array: file.create_dataset(
            name, data=[file.ref] * 4, dtype=h5py.ref_dtype
        )
    ),
    "a compound": dataset(data=np.zeros(4, [("a", "f4"), ("b", "f4")])),
    "a group in place of an array": kernel(lambda file, name, array: file.create_group(name)),
    "a type in place of an array": in_place(np.dtype("f4")),
    "a type beside the layers": beside("type", np.dtype("f4")),
    "one array by 900 names": opened(same_array_again_and_again),
    "a group in itself": opened(circle),
    "40 nested groups": opened(
        lambda file, name: file.create_group("/".join("deep" for _ in range(40)))
    ),
    "30 000 names": opened(many_names),
    "3600 groups": opened(many_in_groups),
    "100 attributes": opened(many_attributes),
    "a huge attribute": opened(
        lambda file, name: file.create_group("new").attrs.create("huge", np.zeros(2**20))
    ),
    "a reference as attribute": opened(
        lambda file, name: file.attrs.create("ref", file.ref, dtype=h5py.ref_dtype)
    ),
    "990 links to 64 attributes": opened(many_links_to_attributes),
    "overlapping heaps": opened(overlapping_heaps),
    "a sparse array of 200 MB": opened(sparse_array),
}

# Changes of bytes, by the HDF5 File Format Specification. The root group comes first.


def patched(change: Callable[[bytearray], None]) -> Change:
    def change_file(path: Path, layout: str) -> None:
        content = bytearray(path.read_bytes())
        change(content)
        path.write_bytes(content)

    return change_file


def every(signature: bytes, content: bytearray) -> list[int]:
    """Returns the offsets at which the signature begins."""
    return [match.start() for match in re.finditer(re.escape(signature), content)]


def put(content: bytearray, offset: int, *words: int) -> None:
    struct.pack_into(f"<{len(words)}Q", content, offset, *words)


def tree_child_is_itself(content: bytearray) -> None:
    for node in every(b"TREE", content):
        content[node + 5] = 1  # its level: its children are nodes too
        put(content, node + 32, node)


def tree_sibling_is_itself(content: bytearray) -> None:
    for node in every(b"TREE", content):
        put(content, node + 16, node)


def circular_free_list(content: bytearray) -> None:
    for heap in every(b"HEAP", content):
        size, free, data = struct.unpack_from("<3Q", content, heap + 8)
        if free < size:  # this heap has free space
            put(content, data + free, free)


def endless_header(content: bytearray) -> None:
    """Makes the object headers continue at their own start."""
    for start in every(b"\x01\x00", content):
        messages, _, size = struct.unpack_from("<HII", content, start + 2)
        if 1 <= messages <= 32 and 24 <= size <= 4096 and start % 8 == 0:
            struct.pack_into("<HHI", content, start + 16, 0x10, 16, 0)
            put(content, start + 24, start + 16, size)


def endless_heap(content: bytearray) -> None:
    for heap in every(b"GCOL", content):
        put(content, heap + 16, 0, 0)  # the first object: number 0, size 0


def declared_length(length: int) -> Callable[[bytearray], None]:
    """Returns a change of the lengths of all strings, which the attributes declare."""

    def change(content: bytearray) -> None:
        for heap in every(b"GCOL", content):
            reference = rb"[\x01-\x20]\0\0\0(?=" + re.escape(struct.pack("<Q", heap)) + rb")"
            for match in list(re.finditer(reference, content, re.DOTALL)):
                struct.pack_into("<I", content, match.start(), length)

    return change


def resized(size: Callable[[int], int]) -> Change:
    """Returns a change of the file's size. A longer file is sparse."""

    def change(path: Path, layout: str) -> None:
        with open(path, "r+b") as file:
            file.truncate(size(path.stat().st_size))

    return change


BY_BYTES: dict[str, Change] = {
    "a B-tree node that is its child": patched(tree_child_is_itself),
    "a B-tree node that is its sibling": patched(tree_sibling_is_itself),
    "a heap with a circular free list": patched(circular_free_list),
    "an object header that continues at its start": patched(endless_header),
    "an endless heap of strings": patched(endless_heap),
    "strings of 4 GiB": patched(declared_length(2**32 - 1)),
    "strings of 2 GiB": patched(declared_length(2**31)),
    "strings of 100 kB": patched(declared_length(100_000)),
    "half a file": resized(lambda size: size // 2),
    "100 bytes": resized(lambda size: 100),
    "one byte less": resized(lambda size: size - 1),
    "a sparse file of 200 MB": resized(lambda size: 200_000_000),
    "a sparse file of 1 GiB and a byte": resized(lambda size: 2**30 + 1),
}

# Changes of one layout.


def one_layer_3000_times(path: Path, layout: str) -> None:
    """Writes a chain that repeats one layer of 1 MB."""
    path.write_bytes(_sound(layout, (512, 512)))
    with h5py.File(path, "r+", libver="latest") as file:
        if layout == "this package":
            names = ["dense", *["dense_1"] * 3000, "dense_2"]
            file.attrs["layer_names"] = np.array(names, "S")
        elif layout == "whole model":
            config = json.loads(file.attrs["model_config"])
            repeat_layer(config)
            names = [layer["config"]["name"] for layer in config["config"]["layers"][1:]]
            file.attrs["model_config"] = json.dumps(config)
            file["model_weights"].attrs["layer_names"] = np.array(names, "S")
        else:
            file.move("layers/dense_2", "layers/dense_3002")
            for i in range(2, 3002):
                file[f"layers/dense_{i}"] = file["layers/dense_1"]


def config_is(text: bytes) -> Change:
    """Returns a change of the settings in a whole model."""
    return opened(lambda file, name: file.attrs.__setitem__("model_config", np.bytes_(text)))


CONFIGS: dict[str, bytes] = {
    "settings that are a list": b"[]",
    "settings that are a number": b"1",
    "settings that are null": b"null",
    "settings without layers": b'{"class_name": "Sequential", "config": {}}',
    "layers that are numbers": b'{"class_name": "Sequential", "config": {"layers": [1, 2, 3]}}',
    "settings that are no JSON": b"{",
    "settings that are no text": b"\xff\xfe\x00",
    "deeply nested settings": b'{"a":' * 12_000,
}

# Zip files.


def packed(change: Callable[[Members], object]) -> Change:
    """Returns a change of the members of a zip file."""
    return lambda path, layout: change_members(path, change)


def change_members(path: Path, change: Callable[[Members], object]) -> None:
    """Changes the members of a zip file."""
    members = read_members(path)
    change(members)
    write_members(path, members)


def read_members(path: Path) -> Members:
    with zipfile.ZipFile(path) as file:
        return {name: file.read(name) for name in file.namelist()}


def write_members(path: Path, members: Members) -> None:
    """Writes a zip file. As in files of Keras, only members of many MB are compressed."""
    with zipfile.ZipFile(path, "w") as file:
        for name, content in members.items():
            kind = zipfile.ZIP_STORED if len(content) < 10**7 else zipfile.ZIP_DEFLATED
            file.writestr(name, content, kind)


def member(name: str, content: bytes) -> Change:
    return packed(lambda members: members.__setitem__(name, content))


def removed(name: str) -> Change:
    return packed(lambda members: members.__delitem__(name) if name in members else None)


def edited(edit: Callable[[Any], object]) -> Callable[[Members], None]:
    """Returns a change of the settings in the member `config.json`."""

    def change(members: Members) -> None:
        config = json.loads(members["config.json"])
        edit(config)
        members["config.json"] = json.dumps(config).encode()

    return change


def bomb(name: str) -> Change:
    """Returns a change that makes a member half a GB of zeros, a thousandth of it compressed."""

    def change(path: Path, layout: str) -> None:
        members = read_members(path)
        del members[name]
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as file:
            for other, content in members.items():
                file.writestr(other, content)
            with file.open(name, "w") as stream:
                for _ in range(512):
                    stream.write(bytes(10**6))

    return change


def encrypted(content: bytearray) -> None:
    for signature, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        for header in every(signature, content):
            content[header + flags] |= 1


def other_config_first(path: Path, layout: str) -> None:
    """Adds a second `config.json`, with another activation, before the first."""
    members = read_members(path)
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("config.json", members["config.json"].replace(b'"tanh"', b'"relu"'))
    with zipfile.ZipFile(path, "a") as file:
        for name, content in members.items():
            file.writestr(name, content)


def weights_of(change: Change) -> Change:
    """Returns a change of the HDF5 file in the zip file."""

    def change_weights(members: Members) -> None:
        with tempfile.TemporaryDirectory() as folder:
            inner = Path(folder, "inner.h5")
            inner.write_bytes(members["model.weights.h5"])
            change(inner, "Keras 3")
            members["model.weights.h5"] = inner.read_bytes()

    return packed(change_weights)


def repeat_layer(config: Any) -> None:
    config["config"]["layers"][2:3] *= 3000


def rename_layer(name: str) -> Change:
    def rename(config: Any) -> None:
        layer = config["config"]["layers"][1]
        layer["class_name"], layer["config"]["name"] = "LeakyReLU", name

    return packed(edited(rename))


def add_activations(config: Any) -> None:
    linear = {"class_name": "Activation", "config": {"name": "a", "activation": "linear"}}
    config["config"]["layers"][2:2] = [linear] * 100_000


def h5_as_keras(path: Path, layout: str) -> None:
    path.write_bytes(read_members(path)["model.weights.h5"])


BY_ZIP: dict[str, Change] = {
    "no config.json": removed("config.json"),
    "no metadata.json": removed("metadata.json"),
    "no weights": removed("model.weights.h5"),
    "no members": packed(lambda members: members.clear()),
    "a member outside": member("../outside.txt", b"text"),
    "a member at the root": member("/outside.txt", b"text"),
    "a bomb of settings": bomb("config.json"),
    "a bomb of weights": bomb("model.weights.h5"),
    "settings of 100 MB": packed(
        lambda members: members.update({"config.json": members["config.json"] + b" " * 10**8})
    ),
    "a list of 100 MB": member("config.json", b"[" + b"[]," * (10**8 // 3) + b"[]]"),
    "metadata of 100 MB": member("metadata.json", b" " * 10**8),
    "encrypted members": patched(encrypted),
    "two members of one name": other_config_first,
    "weights that are no HDF5": member("model.weights.h5", b"text"),
    "half a zip file": resized(lambda size: size // 2),
    "a zip file without its end": resized(lambda size: size - 30),
    "a layer 3000 times": packed(edited(repeat_layer)),
    "100 000 layers": packed(edited(add_activations)),
    "a name with escapes": rename_layer("a\x1b[31m\nerror: b\r\u202e"),
    "a name of a million letters": rename_layer("a" * 10**6),
    "a B-tree node that is its child": weights_of(patched(tree_child_is_itself)),
    "a heap with a circular free list": weights_of(patched(circular_free_list)),
    "data in another file": weights_of(BY_H5PY["data in another file"]),
    "990 links to 64 attributes": weights_of(opened(many_links_to_attributes)),
    **{name: member("config.json", text) for name, text in CONFIGS.items()},
    "HDF5 in place of a zip file": h5_as_keras,
}

HOSTILE: dict[tuple[str, str], Change] = {
    **{
        (kind, layout): change
        for kind, change in {
            **BY_H5PY,
            **BY_BYTES,
            "a layer 3000 times": one_layer_3000_times,
        }.items()
        for layout in KERNEL
    },
    **{(kind, "whole model"): config_is(text) for kind, text in CONFIGS.items()},
    **{(kind, "keras"): change for kind, change in BY_ZIP.items()},
}


def write(kind: str, layout: str, folder: Path) -> Path:
    """Writes a hostile file; returns its path."""
    path = write_sound(layout, folder)
    HOSTILE[kind, layout](path, layout)
    return path

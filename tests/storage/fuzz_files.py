"""Damages files at random, with a fixed seed, and loads them.

Four layouts are damaged: that of this package without its checksum, a whole model as `.h5`, the
weights of Keras 3, and the zip file `.keras`. A damaged file must be refused in one line or load.
Without a checksum a file with another number in it loads as another network.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

from hostile_files import HOSTILE, KERNEL, read_members, write, write_members, write_sound
from load_files import Loader, Outcome

LAYOUTS = (*KERNEL, "keras")
Row = dict[str, Any]
_STRUCTURES = re.compile(rb"TREE|HEAP|SNOD|GCOL|OHDR|FRHP|BTHD|PK\x03\x04|PK\x01\x02|PK\x05\x06")


def random_bytes(content: bytearray, random: Random) -> None:
    start = random.randrange(len(content))
    for i in range(start, min(start + random.choice((1, 1, 2, 4, 16, 256)), len(content))):
        content[i] = random.randrange(256)


def flipped_bits(content: bytearray, random: Random) -> None:
    for _ in range(random.choice((1, 1, 2, 4, 16))):
        content[random.randrange(len(content))] ^= 1 << random.randrange(8)


def zeroed_block(content: bytearray, random: Random) -> None:
    start = random.randrange(len(content))
    end = min(start + random.choice((8, 64, 512, 4096)), len(content))
    content[start:end] = bytes(end - start)


def truncated(content: bytearray, random: Random) -> None:
    del content[random.randrange(len(content)) :]


def duplicated_block(content: bytearray, random: Random) -> None:
    """Copies a block over another one, or inserts it."""
    source, target = random.randrange(len(content)), random.randrange(len(content))
    block = content[source : source + random.choice((8, 32, 128, 1024))]
    end = target if random.random() < 0.3 else target + len(block)
    content[target:end] = block


def replaced_words(content: bytearray, random: Random) -> None:
    """Replaces words of 8 bytes by addresses of structures, by sizes and by extreme numbers."""
    structures = [match.start() for match in _STRUCTURES.finditer(content)] or [0]
    words = (0, 1, 8, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1, len(content), len(content) - 1)
    for _ in range(random.choice((1, 1, 1, 2, 4))):
        start = random.choice(structures) if random.random() < 0.6 else -1
        offset = (
            random.randrange(0, max(len(content) - 8, 1), 8)
            if start < 0
            else start + 8 * random.randrange(8)
        )
        word = random.choice(words if random.random() < 0.5 else structures)
        content[offset : offset + 8] = word.to_bytes(8, "little")


KINDS = (
    *(random_bytes, flipped_bits, zeroed_block, truncated, duplicated_block),
    *(replaced_words, replaced_words),
)


def damage(sound: Path, damaged: Path, seed: str) -> None:
    """Writes a damaged copy of a sound file. The same seed damages equal files alike."""
    random = Random(seed)
    kind = random.choice(KINDS)
    if sound.suffix == ".keras" and random.random() < 0.7:
        # The zip file's own checksums would refuse other damage of a member.
        members = read_members(sound)
        name = random.choice(("config.json", "model.weights.h5", "model.weights.h5"))
        content = bytearray(members[name])
        kind(content, random)
        write_members(damaged, {**members, name: bytes(content)})
    else:
        content = bytearray(sound.read_bytes())
        kind(content, random)
        damaged.write_bytes(content)


Failures = list[tuple[str, Outcome]]


class Sums:
    """The sums of the outcomes of several loads."""

    def __init__(self, file: str) -> None:
        self._file = file
        self._outcomes: Counter[str] = Counter()
        self._seconds = self._memory = self._child_memory = 0.0
        self.failures: Failures = []

    def add(self, name: str, path: Path, outcome: Outcome, expected: str) -> None:
        """Counts a load of the file `path`, of which a sound copy loads as `expected`."""
        kind = _kind(outcome, expected, path)
        self._outcomes[kind] += 1
        if kind in ("failed", "crashed", "endless"):
            self.failures.append((name, outcome))
        self._seconds = max(self._seconds, outcome.seconds)
        self._memory = max(self._memory, outcome.memory)
        self._child_memory = max(self._child_memory, outcome.child_memory)

    def row(self) -> Row:
        return {
            "file": self._file,
            "files": self._outcomes.total(),
            "refused": self._outcomes["refused"],
            "loaded, equal": self._outcomes["equal"],
            "loaded, other": self._outcomes["other"],
            "failed": self._outcomes["failed"],
            "crashed": self._outcomes["crashed"],
            "over 10 s": self._outcomes["endless"],
            "slowest, ms": round(self._seconds * 1e3),
            "memory, MB": round(self._memory, 1),
            "memory of the child, MB": round(self._child_memory, 1),
        }


def _kind(outcome: Outcome, expected: str, path: Path) -> str:
    if outcome.kind == "loaded":
        return "equal" if outcome.text == expected else "other"
    if outcome.kind == "refused":
        one_line = outcome.text.isprintable() and str(path) in outcome.text
        return "refused" if one_line else "failed"
    return outcome.kind


def fuzz(layout: str, count: int, loader: Loader, folder: Path) -> tuple[Row, Failures]:
    """Loads `count` damaged files of a layout.

    Returns a row of sums, and the failures: the seed and the outcome of each load that crashed,
    took too long, or raised another error than one line of WeightsError.
    """
    suffix = ".keras" if layout == "keras" else ".h5"
    sound = write_sound(folder / f"sound{suffix}", layout)
    damaged = folder / f"damaged{suffix}"
    sums = Sums(f"damaged at random, {layout}")
    expected = loader.load(sound).text
    for i in range(count):
        name = f"0 {layout} {i}"
        damage(sound, damaged, name)
        sums.add(name, damaged, loader.load(damaged), expected)
    return sums.row(), sums.failures


def measure_hostile_files(loader: Loader, folder: Path) -> Iterator[tuple[Row, Failures]]:
    """Loads each hostile file; yields a row for each kind, and its failures."""
    kinds: dict[str, list[str]] = {}
    for kind, layout in HOSTILE:
        kinds.setdefault(kind, []).append(layout)
    sound = {
        layout: write_sound(folder / f"{i}{'.keras' if layout == 'keras' else '.h5'}", layout)
        for i, layout in enumerate(LAYOUTS)
    }
    expected = {layout: loader.load(path).text for layout, path in sound.items()}
    for kind, layouts in kinds.items():
        sums = Sums(kind)
        for layout in layouts:
            path = write(kind, layout, folder)
            sums.add(f"{kind}, {layout}", path, loader.load(path), expected[layout])
            path.unlink()
        yield sums.row(), sums.failures

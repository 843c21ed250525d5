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

from hostile_files import HOSTILE, LAYOUTS, read_members, write, write_members, write_sound
from load_files import Loader, Outcome

LONGEST_MESSAGE = 1000  # characters beside the path
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
Loads = list[tuple[str, str, Outcome]]  # name of the file, `kind_of`, outcome


def summary(file: str, loads: Loads) -> tuple[Row, Failures]:
    """Returns a row of sums, and the loads that failed, crashed or took too long."""
    kinds = Counter(kind for _, kind, _ in loads)
    outcomes = [outcome for _, _, outcome in loads]
    row = {
        "file": file,
        "files": len(loads),
        "refused": kinds["refused"],
        "loaded, equal": kinds["equal"],
        "loaded, other": kinds["other"],
        "failed": kinds["failed"],
        "crashed": kinds["crashed"],
        "over 10 s": kinds["endless"],
        "slowest, ms": round(max(outcome.seconds for outcome in outcomes) * 1e3),
        "memory, MB": round(max(0.0, *(outcome.memory for outcome in outcomes)), 1),
        "memory of the child, MB": round(max(0.0, *(each.child_memory for each in outcomes)), 1),
    }
    failed = ("failed", "crashed", "endless")
    return row, [(name, outcome) for name, kind, outcome in loads if kind in failed]


def kind_of(outcome: Outcome, expected: str, path: Path) -> str:
    """Returns the kind of an outcome: `equal` or `other` if the file was loaded.

    It is `refused` only with one printable line that names the file, otherwise `failed`.
    """
    if outcome.kind == "loaded":
        return "equal" if outcome.text == expected else "other"
    if outcome.kind == "refused":
        message = outcome.text.replace(str(path), "", 1)
        one_line = outcome.text.isprintable() and len(message) < LONGEST_MESSAGE
        return "refused" if one_line and message != outcome.text else "failed"
    return outcome.kind


def fuzz(layout: str, count: int, loader: Loader, folder: Path) -> tuple[Row, Failures]:
    """Loads `count` damaged files of a layout; returns their `summary`, which names the seeds."""
    sound = write_sound(layout, folder)
    damaged = sound.with_stem("damaged")
    expected = loader.load(sound).text
    loads: Loads = []
    for i in range(count):
        name = f"0 {layout} {i}"
        damage(sound, damaged, name)
        outcome = loader.load(damaged)
        loads.append((name, kind_of(outcome, expected, damaged), outcome))
    return summary(f"damaged at random, {layout}", loads)


def measure_hostile_files(loader: Loader, folder: Path) -> Iterator[tuple[Row, Failures]]:
    """Loads each hostile file; yields a row for each kind, and its failures."""
    kinds: dict[str, list[str]] = {}
    for kind, layout in HOSTILE:
        kinds.setdefault(kind, []).append(layout)
    expected = {layout: loader.load(write_sound(layout, folder)).text for layout in LAYOUTS}
    for kind, layouts in kinds.items():
        loads: Loads = []
        for layout in layouts:
            path = write(kind, layout, folder)
            outcome = loader.load(path)
            loads.append((f"{kind}, {layout}", kind_of(outcome, expected[layout], path), outcome))
            path.unlink()
        yield summary(kind, loads)

"""Loads files with random damage, in the layouts of Keras 2 and Keras 3 and without a checksum.

    python tests/storage/fuzz_files.py [SEED [COUNT]]

Each file must be refused in one line or load as a network of finite numbers. A load of more than
ten seconds ends the program with a traceback, a crash ends it too. Prints the number of refused and
of loaded files. 1000 files take half a minute.
"""

from __future__ import annotations

import faulthandler
import sys
import tempfile
from collections import Counter
from pathlib import Path
from random import Random

import numpy as np

import keras_pendulum as kp

CHANGES = (1, 1, 2, 4, 16)  # per file


def damaged(content: bytes, random: Random) -> bytes:
    """Returns the file with flipped bits, extreme values, or copied bytes at random offsets."""
    changed = bytearray(content)
    for _ in range(random.choice(CHANGES)):
        offset = random.randrange(len(changed))
        kind = random.randrange(4)
        if kind == 0:
            changed[offset] ^= 1 << random.randrange(8)
        elif kind == 1:
            changed[offset] = random.choice((0, 1, 127, 128, 255))
        elif kind == 2:
            length = random.choice((2, 4, 8))
            changed[offset : offset + length] = random.choice((b"\xff", b"\0", b"\x7f")) * length
        else:
            length = random.randrange(1, 64)
            source = random.randrange(len(changed))
            changed[offset : offset + length] = changed[source : source + length]
    return bytes(changed)


def outcome(path: Path) -> str:
    """Returns "refused" or "loaded". Raises AssertionError for any other outcome."""
    try:
        network = kp.load_weights(path)
    except kp.WeightsError as error:
        assert str(error).startswith(str(path)), error
        assert "\n" not in str(error), error
        return "refused"
    assert all(np.isfinite(array).all() for array in network.get_weights()), path
    return "loaded"


def main(seed: str = "0", count: str = "1000") -> None:
    """Loads `count` files and prints the outcomes."""
    random = Random(int(seed))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        network = kp.DQN((16, 8), 5)
        network.save_weights(folder / "keras3.weights.h5")
        kp.save_weights(network, folder / "keras2.h5")
        with_checksum = (folder / "keras2.h5").read_bytes()
        originals = [
            with_checksum[: with_checksum.rindex(b"\nkeras_pendulum sha256")],
            (folder / "keras3.weights.h5").read_bytes(),
            (Path(__file__).parents[1] / "data" / "pendulum_weight.keras2.h5").read_bytes(),
        ]
        outcomes: Counter[str] = Counter()
        for _ in range(int(count)):
            path = folder / "damaged.h5"
            path.write_bytes(damaged(random.choice(originals), random))
            faulthandler.dump_traceback_later(10, exit=True)
            outcomes[outcome(path)] += 1
            faulthandler.cancel_dump_traceback_later()
    print(", ".join(f"{times} {what}" for what, times in sorted(outcomes.items())))


if __name__ == "__main__":
    main(*sys.argv[1:])

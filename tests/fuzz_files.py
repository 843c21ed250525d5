"""Loads files with random damage, in the layouts of Keras 2 and Keras 3 and without a digest.

    python tests/fuzz_files.py [SEED [COUNT]]

Each must be refused in one line or give a network of finite numbers; a load that takes longer than
ten seconds ends the program with a traceback, and one that kills it ends it too. Ends with how
often each happened. A thousand take half a minute.
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

DAMAGED_AT_ONCE = (1, 1, 2, 4, 16)  # places in a file


def damaged(content: bytes, random: Random) -> bytes:
    """The file with flipped bits, telling values, or bytes of elsewhere in a few places."""
    changed = bytearray(content)
    for _ in range(random.choice(DAMAGED_AT_ONCE)):
        place = random.randrange(len(changed))
        kind = random.randrange(4)
        if kind == 0:
            changed[place] ^= 1 << random.randrange(8)
        elif kind == 1:
            changed[place] = random.choice((0, 1, 127, 128, 255))
        elif kind == 2:
            length = random.choice((2, 4, 8))
            changed[place : place + length] = random.choice((b"\xff", b"\0", b"\x7f")) * length
        else:
            length = random.randrange(1, 64)
            source = random.randrange(len(changed))
            changed[place : place + length] = changed[source : source + length]
    return bytes(changed)


def outcome(path: Path) -> str:
    """`refused` or `loaded`. Raises AssertionError for any other end."""
    try:
        network = kp.load_weights(path)
    except kp.WeightsError as error:
        assert str(error).startswith(str(path)), error
        assert "\n" not in str(error), error
        return "refused"
    assert all(np.isfinite(array).all() for array in network.get_weights()), path
    return "loaded"


def main(seed: str = "0", count: str = "1000") -> None:
    """Loads so many files."""
    random = Random(int(seed))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        network = kp.DQN((16, 8), 5)
        network.save_weights(folder / "keras3.weights.h5")
        kp.save_weights(network, folder / "keras2.h5")
        ours = (folder / "keras2.h5").read_bytes()
        whole = [
            ours[: ours.rindex(b"\nkeras_pendulum sha256")],
            (folder / "keras3.weights.h5").read_bytes(),
            (Path(__file__).parent / "data" / "pendulum_weight.keras2.h5").read_bytes(),
        ]
        outcomes: Counter[str] = Counter()
        for _ in range(int(count)):
            path = folder / "damaged.h5"
            path.write_bytes(damaged(random.choice(whole), random))
            faulthandler.dump_traceback_later(10, exit=True)
            outcomes[outcome(path)] += 1
            faulthandler.cancel_dump_traceback_later()
    print(", ".join(f"{times} {what}" for what, times in sorted(outcomes.items())))


if __name__ == "__main__":
    main(*sys.argv[1:])

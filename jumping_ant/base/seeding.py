"""Seeds of all streams of random numbers, derived from a seed, a purpose and an index.

NumPy's `SeedSequence` turns the three into a seed of 128 bits, so that no two runs, purposes or
environments share a stream. Source: O'Neill 2015, "Developing a seed_seq alternative".
"""

from typing import Literal, get_args

import numpy as np

Purpose = Literal[
    "starts", "learner", "replay", "actions", "search", "samples", "test", "perturbation"
]
_PURPOSES = get_args(Purpose)  # results depend on their order: add new ones at the end


def derive(seed: int, purpose: Purpose, index: int = 0, bits: Literal[32, 128] = 128) -> int:
    """Return the seed of one stream: of a run's seed, a purpose, and an environment's number.

    Older kinds of generators take only 32 bits.
    """
    sequence = np.random.SeedSequence(seed, spawn_key=(_PURPOSES.index(purpose), index))
    words = sequence.generate_state(bits // 32, np.uint32)
    return int.from_bytes(words.astype("<u4").tobytes(), "little")


def derive_all(seed: int, purpose: Purpose, count: int) -> list[int]:
    """Return the seeds of streams 0 to `count - 1` for a purpose."""
    return [derive(seed, purpose, index) for index in range(count)]

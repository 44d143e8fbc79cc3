"""Streams of random numbers: none is shared, and none changes from release to release."""

from typing import get_args

import pytest

from jumping_ant.base.seeding import Purpose, derive

PURPOSES = get_args(Purpose)


@pytest.mark.parametrize("bits", [32, 128])
def test_no_two_streams_coincide(bits: int) -> None:
    seeds = [
        derive(seed, purpose, index, bits)
        for seed in range(21)
        for purpose in PURPOSES
        for index in range(41)
    ]
    assert len(set(seeds)) == len(seeds) == 21 * len(PURPOSES) * 41
    assert min(seeds) >= 0 and 2 ** (bits - 3) < max(seeds) < 2**bits


def test_the_seeds_are_part_of_every_result() -> None:
    """NumPy promises that its SeedSequence stays as it is; what is made of it here must, too."""
    named = ("starts", "learner", "replay", "actions", "search", "samples", "test", "perturbation")
    assert named == PURPOSES
    assert derive(7, "starts", 3) == 211193353590839443487384849143270691103
    assert derive(7, "starts", 3, bits=32) == 31412511
    assert derive(7, "samples", 3) == 26359170599376513052782447718271347371
    assert derive(0, "learner", bits=32) == 3953331965

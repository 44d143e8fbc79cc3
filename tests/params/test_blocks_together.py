"""What blocks of `params.yaml` require of each other: imitators, and episodes of one purpose."""

import functools
import operator
from typing import Any

import pytest
from changed_params import changed, refusal

from jumping_ant.params import params_file, presets

BC = presets.load("families").model_dump()["agents"]["bc"]
DEMONSTRATIONS = presets.load("families").model_dump()["demonstrations"]["bc"]


@pytest.mark.parametrize(
    ("agent", "demonstrations", "said"),
    [
        ({}, None, "demonstrations: given none for agents.bc, allowed: bc: {agent: ...}"),
        ({"robot": "unedited"}, {}, "agents.bc.robot: given another than that of sac, whom it"),
        ({"actions": {"kind": "torques", "amplitude": 1.0, "hold": 1}}, {}, "agents.bc.actions:"),
        (
            {"total_steps": 12001},
            {},
            "agents.bc.total_steps: given 12001, allowed: at most demons",
        ),
        (
            {},
            {"agent": "dqn"},
            "demonstrations.bc.agent: given 'dqn', allowed: learners that choose",
        ),
        (
            {},
            {"agent": "bc"},
            "given 'bc', allowed: learners that choose torques (sac, pgpe, oscillator)",
        ),
    ],
)
def test_imitators_fit_what_they_imitate(
    agent: dict[str, Any], demonstrations: dict[str, Any] | None, said: str
) -> None:
    content = changed("agents.bc", BC | agent)
    if demonstrations is not None:
        content["demonstrations"] = {"bc": DEMONSTRATIONS | demonstrations}
    assert said in refusal(content)


def test_demonstrations_are_for_algorithms_that_need_them() -> None:
    line = refusal(changed("demonstrations", {"sac": DEMONSTRATIONS}))
    assert line == "params.yaml: demonstrations.sac: Input should be 'bc' or 'dagger', given 'sac'"
    beyond = DEMONSTRATIONS | {"seed": 9_000_000 + 32 * 46}
    params_file.check(changed("demonstrations", {"bc": beyond}))


SEEDS = {"seeds": [*range(20, 28)]}  # whose held-out episodes are 32 each
HELD_OUT, VALIDATION = "evaluate.seed", "training.evaluation_seed"
IMITATION = "demonstrations.bc.seed"


@pytest.mark.parametrize(
    ("key", "seed", "own", "other", "other_key"),
    [
        (HELD_OUT, 2_000_400 - 640, "2000400 to 2000431", "2000400 to 2000419", VALIDATION),
        (HELD_OUT, 2_000_369 - 640, "2000369 to 2000400", "2000400 to 2000419", VALIDATION),
        (HELD_OUT, 2_000_369 - 864, "2000369 to 2000400", "2000400 to 2000419", VALIDATION),
        (HELD_OUT, 7_999_999 - 640, "7999999 to 8000030", "7000000 to 7999999", "make tune"),
        (VALIDATION, 6_999_590, "6999990 to 7000009", "7000000 to 7999999", "make tune"),
        (IMITATION, 8_990_000, "8990000 to 9001999", "9000640 to 9000671", HELD_OUT),
        (IMITATION, 2_000_419, "2000419 to 2012418", "2000400 to 2000419", VALIDATION),
    ],
)
def test_no_episode_serves_two_purposes(
    key: str, seed: int, own: str, other: str, other_key: str
) -> None:
    content = changed("demonstrations", {"bc": dict(DEMONSTRATIONS)}) | SEEDS
    *blocks, last = key.split(".")
    functools.reduce(operator.getitem, blocks, content)[last] = seed
    assert refusal(content) == (
        f"params.yaml: {key}: given episodes of the seeds {own}, allowed: none of {other}, those "
        f"of {other_key}"
    )


@pytest.mark.parametrize(
    ("first", "seeds"),
    [(2_000_420 - 640, [20, 27]), (2_000_368 - 864, [20, 27]), (1_999_900, [0, 4])],
)
def test_episodes_may_lie_side_by_side(first: int, seeds: list[int]) -> None:
    content = changed(HELD_OUT, first)
    content["seeds"] = seeds
    assert params_file.check(content).evaluate.seed == first


def test_episodes_played_beyond_the_settings_count() -> None:
    """PGPE's best sample is chosen on 20, however few validate; demonstrations are in batches."""
    content = changed("training.evaluation_episodes", 1) | SEEDS
    content["evaluate"]["seed"] = 2_000_419 - 640
    assert "none of 2000400 to 2000419, those of training" in refusal(content)
    one = DEMONSTRATIONS | {"steps": 1, "seed": 9_000_625}
    line = refusal(changed("demonstrations", {"bc": one}) | SEEDS)
    assert "of the seeds 9000625 to 9000640" in line

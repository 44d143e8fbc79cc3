"""How training speeds up with threads: what is timed, and the table of it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import small_agents

from jumping_ant.base.files import write_text
from jumping_ant.params.model import Params
from jumping_ant.training import scaling

NET: dict[str, Any] = {"net_arch": [16], "batch_size": 8, "num_envs": 2, "gradient_steps": 64}
SMALL = {"pgpe": {"population_size": 6, "episode_steps": 10}, "dqn": NET, "sac": NET}


@pytest.fixture
def settings(known_params: Params, robot_xml: str, tmp_path: Path) -> Params:
    write_text(tmp_path / "assets" / "edited.xml", robot_xml)
    agents = small_agents.agents() | {
        name: known_params.agent(name).model_copy(update=own) for name, own in SMALL.items()
    }
    return known_params.model_copy(update={"agents": agents, "seeds": [0, 5]})


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize(("cores", "counts"), [(1, [1]), (3, [1, 2, 3])])
def test_each_seed_is_timed_on_one_thread_up_to_all(
    settings: Params, tmp_path: Path, name: str, cores: int, counts: list[int]
) -> None:
    found = scaling.measure(tmp_path, settings, name, cores)
    assert list(found) == counts
    assert all(own.shape == (2,) and (own > 0).all() and (own < 60).all() for own in found.values())


@pytest.mark.parametrize("name", ["random", "open_loop", "snes", "ppo", "td3", "bc"])
def test_what_no_claim_compares_is_not_timed(settings: Params, tmp_path: Path, name: str) -> None:
    assert scaling.measure(tmp_path, settings, name) == {}


def test_all_agents_are_timed_with_their_first_seeds(settings: Params, tmp_path: Path) -> None:
    agents = {name: settings.agent(name) for name in ("random", "pgpe")}
    seeds = [*range(5, 5 + scaling.SEEDS), 2]
    few = settings.model_copy(update={"agents": agents, "seeds": seeds})
    found = scaling.measure_all(tmp_path, few)
    assert list(found) == ["random", "pgpe"] and found["random"] == {}
    assert [len(own) for own in found["pgpe"].values()] == [scaling.SEEDS] * len(found["pgpe"])


def test_the_table_has_a_row_for_each_time() -> None:
    found = {"random": {}, "pgpe": {1: np.array([2.0, 2.5]), 2: np.array([1.25, 1.5])}}
    assert scaling.to_csv(found, [7, 3]) == (
        "agent,seed,threads,seconds\npgpe,7,1,2.0\npgpe,7,2,1.25\npgpe,3,1,2.5\npgpe,3,2,1.5\n"
    )

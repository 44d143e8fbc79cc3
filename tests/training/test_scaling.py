from pathlib import Path

import pytest
import small_agents

from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import scaling_table
from jumping_ant.experiment.models import Params
from jumping_ant.sim.world import World
from jumping_ant.training import scaling

SEEDS = [0, 5]


def small(known: Params) -> Params:
    pgpe = known.agents["pgpe"].model_copy(update={"population_size": 6, "episode_steps": 10})
    return known.model_copy(update={"agents": known.agents | {"pgpe": pgpe}})


def test_each_seed_is_timed_on_one_thread_up_to_all(known_params: Params, robot_xml: str) -> None:
    settings = small(known_params)
    rows = scaling.measure(World(robot_xml, settings.env), settings.agent("pgpe"), SEEDS, cores=3)
    assert [tuple(row) for row in rows] == [tuple(scaling_table.COLUMNS)] * 6
    assert [(row["seed"], row["threads"]) for row in rows] == [
        (seed, threads) for seed in SEEDS for threads in (1, 2, 3)
    ]
    assert all(0 < row["seconds"] < 60 for row in rows)


def test_learners_that_update_one_policy_are_timed_too(
    known_params: Params, robot_xml: str
) -> None:
    for name in ("dqn", "sac"):
        small_net = {"net_arch": [16], "batch_size": 8, "num_envs": 2, "gradient_steps": 64}
        agent = known_params.agent(name).model_copy(update=small_net)
        rows = scaling.measure(World(robot_xml, known_params.env), agent, [3], cores=2)
        assert [(row["seed"], row["threads"]) for row in rows] == [(3, 1), (3, 2)]
        assert all(0 < row["seconds"] < 60 for row in rows)


@pytest.mark.parametrize("algorithm", ["random", "open_loop", "snes", "ppo", "td3", "bc"])
def test_what_no_claim_compares_is_not_timed(
    known_params: Params, robot_xml: str, algorithm: str
) -> None:
    agent = small_agents.agents()[algorithm]
    assert scaling.measure(World(robot_xml, known_params.env), agent, SEEDS) == []


def test_the_table_is_read_back(known_params: Params, robot_xml: str, tmp_path: Path) -> None:
    settings = small(known_params)
    rows = scaling.measure(World(robot_xml, settings.env), settings.agent("pgpe"), SEEDS, cores=2)
    write_text(Paths(tmp_path).agent("pgpe").scaling, scaling_table.to_csv("pgpe", rows))
    read = scaling_table.read(tmp_path, settings.model_copy(update={"seeds": SEEDS}), "pgpe")
    assert list(read) == [1, 2]
    assert read[2].tolist() == [row["seconds"] for row in rows if row["threads"] == 2]


def test_no_more_seeds_are_timed_than_the_repetitions_that_are_asked_for(
    known_params: Params, tmp_path: Path
) -> None:
    seeds = [*range(5, 5 + scaling_table.REPETITIONS), 2]
    settings = known_params.model_copy(update={"seeds": seeds})
    rows = [{"seed": seed, "threads": 1, "seconds": 1.0} for seed in scaling_table.seeds(settings)]
    write_text(Paths(tmp_path).agent("pgpe").scaling, scaling_table.to_csv("pgpe", rows))
    assert [row["seed"] for row in rows] == seeds[:-1]
    assert len(scaling_table.read(tmp_path, settings, "pgpe")[1]) == len(rows)

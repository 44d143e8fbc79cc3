from pathlib import Path

from jumping_ant import comparison, params, scaling
from jumping_ant.params import Params

SEEDS = [0, 5]


def small(known: Params) -> Params:
    content = known.model_dump()
    pgpe = content["agents"]["pgpe"] | {"population_size": 6, "episode_steps": 10}
    return params.check(content | {"seeds": SEEDS, "agents": content["agents"] | {"pgpe": pgpe}})


def test_each_seed_is_timed_on_one_thread_up_to_all(known_params: Params, robot_xml: str) -> None:
    rows = scaling.measure(robot_xml, small(known_params), cores=3)
    assert [tuple(row) for row in rows] == [scaling.COLUMNS] * 6
    assert [(row["agent"], row["seed"], row["threads"]) for row in rows] == [
        ("pgpe", seed, threads) for seed in SEEDS for threads in (1, 2, 3)
    ]
    assert all(0 < row["seconds"] < 60 for row in rows)


def test_agents_without_a_population_are_not_timed(known_params: Params, robot_xml: str) -> None:
    settings = known_params.model_copy(update={"agents": {"dqn": known_params.agents["dqn"]}})
    assert scaling.measure(robot_xml, settings) == []


def test_the_table_is_read_back(known_params: Params, robot_xml: str, tmp_path: Path) -> None:
    rows = scaling.measure(robot_xml, small(known_params), cores=2)
    path = tmp_path / "results" / "scaling.csv"
    path.parent.mkdir()
    path.write_text(comparison.to_csv(rows))
    read = comparison._read_scaling(tmp_path, "pgpe")
    assert read[2].tolist() == [row["seconds"] for row in rows if row["threads"] == 2]

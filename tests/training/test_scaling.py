"""What pieces of training take: what is timed, and the table of it."""

from pathlib import Path
from typing import Any

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


def test_all_learners_are_timed_by_turns(settings: Params, tmp_path: Path) -> None:
    agents = {name: settings.agent(name) for name in ("random", "pgpe", "ppo", "dqn", "sac")}
    found = scaling.measure(tmp_path, settings.model_copy(update={"agents": agents}), 3)
    assert [piece[:3] for piece in found] == [
        (name, repeat, threads)
        for repeat in range(scaling.REPEATS)
        for name in SMALL
        for threads in (1, 2, 3)
    ]
    steps = {"pgpe": 60, "dqn": 2 * 3, "sac": 2 * 3}  # a generation; a round of held decisions
    for piece in found:
        assert piece.env_steps == steps[piece.agent]
        assert 0 < piece.seconds < 60 and 0 < piece.cpu_seconds < 60


def test_they_run_in_a_process_of_their_own(settings: Params, tmp_path: Path) -> None:
    agents = {"pgpe": settings.agent("pgpe")}
    found = scaling.measure_all(tmp_path, settings.model_copy(update={"agents": agents}))
    assert {piece.threads for piece in found} >= {1}
    lines = scaling.to_csv(found).splitlines()
    assert lines[0] == "agent,repeat,threads,env_steps,seconds,cpu_seconds"
    assert len(lines) == 1 + len(found)


def test_nothing_to_time_is_an_empty_table() -> None:
    assert scaling.to_csv([]) == "agent,repeat,threads,env_steps,seconds,cpu_seconds\n"

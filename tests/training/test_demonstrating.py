"""Who demonstrates, and what."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from small_training import small_params

from jumping_ant.agents.imitation.demonstrations import Demonstrations
from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import curves
from jumping_ant.experiment.models import Params
from jumping_ant.sim.world import World
from jumping_ant.training import demonstrating, driver
from jumping_ant.training.checkpoint_key import checkpoint_key

COLUMNS = ",".join(["agent", "seed", *curves.COLUMNS])


@pytest.fixture
def params(project: Path) -> Params:
    """Parameters of a project with trained agents, one of which demonstrates."""
    params = small_params(1)
    driver.train(project, params, params.demonstrations["bc"].agent)
    return params


def write_curves(project: Path, params: Params, *returns: tuple[float, float]) -> dict[int, bytes]:
    """Write learning curves of two evaluations for each seed, and return the policies."""
    agent = params.demonstrations["bc"].agent
    paths = Paths(project).agent(agent)
    for seed, values in zip(params.seeds, returns, strict=True):
        ends = params.agent(agent).max_env_steps // 2, params.agent(agent).max_env_steps
        rows = [
            f"{agent},{seed},{end},,,,,{value},1.0" for end, value in zip(ends, values, strict=True)
        ]
        paths.seed(seed).curve.write_text("\n".join([COLUMNS, *rows, ""]), encoding="utf-8")
        paths.seed(seed).policy.write_bytes(paths.seed(seed).policy.read_bytes())
    return {seed: paths.seed(seed).policy.read_bytes() for seed in params.seeds}


def test_the_best_in_validation_demonstrates(project: Path, params: Params) -> None:
    policies = write_curves(project, params, (900.0, 100.0), (200.0, 300.0))
    made = demonstrating.demonstrate(project, params, "bc")
    assert made.expert == policies[params.seeds[0]]
    last = params.training.model_copy(update={"publish": "final"})
    made = demonstrating.demonstrate(project, params.model_copy(update={"training": last}), "bc")
    assert made.expert == policies[params.seeds[1]]


def test_episodes_are_as_the_parameters_say(project: Path, params: Params) -> None:
    settings = params.demonstrations["bc"]
    made = demonstrating.demonstrate(project, params, "bc", num_threads=2)
    assert made.to_bytes() == demonstrating.demonstrate(project, params, "bc").to_bytes()
    hold = params.agents["bc"].actions.hold
    assert len(made.labelled) * hold >= settings.steps
    lengths = [len(episode) * hold for episode in made.labelled.episodes()]
    assert max(lengths) <= settings.episode_steps + hold
    heights = np.array([episode.observations[0, 0] for episode in made.labelled.episodes()])
    assert (heights > 1.0).any() and (heights < 1.0).any()  # some start in the air


def test_an_imitator_is_trained_on_them(project: Path, params: Params) -> None:
    path = Paths(project).demonstrations("bc")
    path.unlink()
    with pytest.raises(InputError, match=r"demonstrations.zip: .*`dvc repro demonstrate@bc`"):
        driver.train(project, params, "bc")
    made = demonstrating.demonstrate(project, params, "bc")
    path.write_bytes(made.to_bytes())
    driver.train(project, params, "bc")
    assert (project / "models" / "bc" / "seed-0" / "policy.zip").is_file()
    key_of = partial(checkpoint_key, World("xml", params.env), params.training, params.agent("bc"))
    other = Demonstrations(made.labelled[1:], made.expert).to_bytes()
    assert key_of(made.to_bytes()) != key_of(other)

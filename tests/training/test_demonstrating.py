"""Who demonstrates, and what."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from small_training import small_params

from jumping_ant.agents.imitation.demonstrations import Demonstrations
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params.model import Params
from jumping_ant.sim.world import World
from jumping_ant.training import curves, demonstrating, driver
from jumping_ant.training.checkpoints import checkpoint_key

COLUMNS = ",".join(["agent", "seed", *curves.VALIDATION_COLUMNS])


@pytest.fixture
def params(project: Path) -> Params:
    """Parameters of a project with trained agents, one of which demonstrates."""
    params = small_params(1)
    driver.train(project, params, params.demonstrations["bc"].agent)
    return params


@pytest.mark.parametrize(("others", "best"), [(300.0, 0), (950.0, 1)])
def test_the_best_in_validation_demonstrates(
    project: Path, params: Params, others: float, best: int
) -> None:
    """By the better of two finalists, whose policy a seed has published."""
    agent = params.demonstrations["bc"].agent
    paths = Paths(project).agent(agent)
    paths.training.unlink()  # has digests of what was trained
    returns = [(900.0, 100.0), (200.0, others)]
    for seed, finalists in zip(params.seeds, returns, strict=True):
        rows = [f"{agent},{seed},{100 * i},20,{mean},1.0" for i, mean in enumerate(finalists)]
        write_text(paths.seed(seed).validation, "\n".join([COLUMNS, *rows, ""]))
    made = demonstrating.demonstrate(project, params, "bc")
    assert made.expert == paths.seed(params.seeds[best]).policy.read_bytes()


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

"""PGPE compared with EvoTorch's problem for Gymnasium environments, one actor per core."""

import logging
from collections.abc import Callable
from functools import partial
from itertools import islice

import ray
from evotorch.algorithms import PGPE
from evotorch.neuroevolution import GymNE

from benchmarks.article_ant import ArticleAnt, article_agent, default_world
from benchmarks.measure import CORES, Row, compare_apart, rate
from jumping_ant.agents.evolution import trainer
from jumping_ant.agents.job import Job
from jumping_ant.agents.kernels import use_portable_kernels

GENERATIONS = 2  # per repeat


def pgpe_vs_gymne() -> Row:
    """Compare generations per second, each on all cores."""
    return compare_apart("pgpe_vs_gymne", "generations/s", partial(project, CORES), gymne)


def project(num_threads: int) -> Callable[[], float]:
    """Start the project's training with the article's settings.

    Args:
        num_threads: Threads that step the simulations; torch has one, as in the pipeline.
    """
    use_portable_kernels()
    agent = article_agent("pgpe")
    events = trainer.train(Job(default_world(), agent, seed=0, num_threads=num_threads))
    next(events)
    return lambda: rate(lambda: list(islice(events, GENERATIONS)), GENERATIONS)


def gymne() -> Callable[[], float]:
    """Start the article's script."""
    logging.getLogger("evotorch").setLevel(logging.WARNING)
    ray.init(logging_level=logging.ERROR, log_to_driver=False, include_dashboard=False)
    agent = article_agent("pgpe")
    problem = GymNE(
        ArticleAnt,
        "Linear(obs_length, act_length)",
        num_actors="max",
        observation_normalization=agent.observation_normalization,
        decrease_rewards_by=agent.decrease_rewards_by,
        episode_length=agent.episode_steps,
    )
    searcher = PGPE(
        problem,
        popsize=agent.population_size,
        center_learning_rate=agent.center_learning_rate,
        stdev_learning_rate=agent.stdev_learning_rate,
        stdev_init=agent.stdev_init,
        optimizer="clipup",
        optimizer_config={"max_speed": agent.max_speed, "momentum": agent.momentum},
    )
    searcher.run(1)  # starts the actors
    return lambda: rate(partial(searcher.run, GENERATIONS), GENERATIONS)

"""What each stage computes, in seconds of the machine of the committed run.

The seconds are those of `benchmarks/full_run.json` and `results/timing/`, of other algorithms in
proportion to these. What is simulation or drawing runs on all cores, what a stage does besides on
one. Counted are control steps, gradient steps, frames, agents and policies; an episode counts with
its full length.
"""

import operator
from collections.abc import Mapping
from typing import Any, NamedTuple

from jumping_ant.experiment import scaling_table, variant_names
from jumping_ant.experiment.models import Params
from jumping_ant.robustness import playing

STEP = 143e-6  # [s] of a control step of the Ant
START = 1.6  # [s] until Python has imported what a stage needs
LEARNER_START = 3.0  # [s] the same for training with PyTorch
SEED_START = 1.1  # [s] of the process that trains a seed
# Gradient steps: [s] of each, and for a million multiplications of a batch with hidden layers.
GRADIENT_STEPS = {
    **dict.fromkeys(("dqn", "decqn"), (0.1e-3, 0.083e-3)),
    "qrdqn": (1.2e-3, 0.12e-3),
    "sac": (0.85e-3, 0.30e-3),
    **dict.fromkeys(("td3", "ddpg"), (1.5e-3, 0.26e-3)),
    "tqc": (4.9e-3, 0.40e-3),
    "crossq": (3.3e-3, 0.50e-3),
    "a2c": (3.8e-3, 0.0),
    "ppo": (1.5e-3, 0.16e-3),
    **dict.fromkeys(("bc", "dagger"), (0.3e-3, 0.08e-3)),
}
# Stages that no agent names: [s], and for each agent and each policy.
SUMMARIES = {
    "digest": (2.0, 0.0, 0.0),
    "check": (1.2, 0.0, 0.0),
    "build": (1.5, 0.0, 0.0),
    "lineup": (2.5, 0.35, 0.0),
    "compare": (4.0, 0.3, 0.015),
    "crossings": (2.5, 0.08, 0.0),
    "speed": (3.0, 0.3, 0.0),
    "report": (4.0, 0.55, 0.0),
    "play": (2.5, 0.0, 0.01),
    "track": (5.0, 0.3, 0.05),
}
SAMPLED_EPISODES = 144  # by which the best of a search's samples is chosen


class Load(NamedTuple):
    """Work: what one core does [s], and what all share [s of a core]."""

    alone: float
    shared: float = 0.0

    @property
    def core_seconds(self) -> float:
        """Seconds of all cores together."""
        return self.alone + self.shared

    def seconds(self, cores: int) -> float:
        """Seconds on so many cores."""
        return self.alone + self.shared / cores


def load(
    params: Params, stage: str, cores: int, step: float = STEP, trained: int = 0
) -> tuple[float, float]:
    """Return the seconds and the core-seconds of a stage.

    Args:
        params: All parameters.
        stage: Its name, as in `train@sac`.
        cores: Cores of the machine.
        step: Seconds of a control step of this robot.
        trained: How many of an agent's seeds are trained already.
    """
    kind, _, name = stage.partition("@")
    if kind == "train":
        return _training(params, name, cores, step, len(params.seeds) - trained)
    own = _of_agent(params, kind, name, cores, step)
    if kind in SUMMARIES:
        fixed, for_agent, for_policy = SUMMARIES[kind]
        num_agents = len(params.agents)
        own = Load(fixed + num_agents * (for_agent + len(params.seeds) * for_policy))
    return own.seconds(cores), own.core_seconds


def _of_agent(params: Params, kind: str, name: str, cores: int, step: float) -> Load:
    """Return the work of a stage that evaluates, films or times."""
    length, num_seeds = params.env.max_episode_steps, len(params.seeds)
    if kind == "evaluate":
        agent = params.agent(name)
        episodes = variant_names.num_episodes(agent, params.evaluate)
        variants = () if agent.is_baseline else variant_names.of_agent(agent)
        played = sum(episodes[version] for version in (variant_names.PUBLISHED, *variants))
        played += SAMPLED_EPISODES * (agent.algorithm in variant_names.SAMPLED)
        return Load(START, num_seeds * played * length * step)
    if kind == "robustness":
        played = sum(1 for _ in playing.cases(params, name))
        return Load(START, played * params.robustness.episode_steps * step)
    if kind in ("record", "overtaking"):
        film, dt = params.record, params.env.frame_skip * 0.01
        length = length if kind == "record" else params.robustness.episode_steps
        frames = min(film.seconds, length * dt) * film.fps
        pixels = film.width * film.height / 480**2
        loaded = 9.0 if kind == "overtaking" else 2.5
        return Load(loaded + 2e-3 * length, frames * (5e-3 + 11e-3 * pixels))
    if kind == "demonstrate":
        return Load(START, params.demonstrations[name].steps * step)
    if kind == "scaling" and (timed := scaling_table.timed(params.agent(name))):
        unit = _training_of_a_seed(timed, step)
        share = 0.5 if hasattr(timed, "gradient_steps") else 1.0  # two rows of the curve
        num_timed = 2 * len(scaling_table.seeds(params))
        counts = list(scaling_table.thread_counts(cores))
        alone = num_timed * share * unit.alone * len(counts)
        shared = num_timed * share * unit.shared * sum(cores / count for count in counts)
        return Load(START + alone, shared)
    return Load(START)


def _training(
    params: Params, name: str, cores: int, step: float, num_seeds: int
) -> tuple[float, float]:
    """Return seconds and core-seconds of a training: rounds of as many seeds as there are workers.

    The seeds of a last round that is not full share the cores, as far as they simulate.
    """
    agent, training = params.agent(name), params.training
    own, length = _training_of_a_seed(agent, step), params.env.max_episode_steps
    if agent.is_baseline:  # one snapshot of each seed, or of all
        searches = num_seeds if agent.depends_on_seed else min(num_seeds, 1)
        validation = training.evaluation_episodes * length * step
        whole = Load(START, searches * (own.shared + validation))
        return whole.seconds(cores), whole.core_seconds
    finalists = training.finalists if training.publish == "best" else 1
    finals = min(finalists, training.evaluations) * training.finalist_episodes * (finalists > 1)
    played = training.evaluations * training.evaluation_episodes + finals
    seed = Load(own.alone + SEED_START, own.shared + played * length * step)
    workers = min(params.compute.workers or cores, max(num_seeds, 1))
    rounds, rest = divmod(num_seeds, workers)
    seconds = rounds * seed.seconds(max((params.compute.workers or cores) // workers, 1))
    seconds += seed.seconds(max(workers // rest, 1)) if rest else 0.0
    return LEARNER_START + seconds, LEARNER_START + num_seeds * seed.core_seconds


def _training_of_a_seed(agent: Any, step: float) -> Load:
    """Return the work of training a seed: gradient steps, and control steps."""
    alone, for_million = GRADIENT_STEPS.get(agent.algorithm, (0.0, 0.0))
    if hasattr(agent, "net_arch"):
        sizes = [32, *agent.net_arch, 8]
        weights = sum(map(operator.mul, sizes, sizes[1:]))
        alone += for_million * getattr(agent, "batch_size", 0) * weights / 1e6
    return Load(_gradient_steps(agent) * alone, agent.max_env_steps * step)


def _gradient_steps(agent: Any) -> float:
    """Return how many gradient steps the training of a seed has."""
    settings: Mapping[str, Any] = agent.model_dump()
    if "learning_starts" in settings:
        decisions = agent.total_steps / agent.actions.hold - agent.learning_starts
        return float(decisions / (agent.num_envs * agent.train_freq) * agent.gradient_steps)
    if "n_epochs" in settings:
        return float(agent.total_steps / agent.actions.hold / agent.batch_size * agent.n_epochs)
    if "gae_lambda" in settings:
        return float(agent.total_steps / agent.round_steps)
    return float(settings.get("rounds", 0) * settings.get("updates_per_round", 0))

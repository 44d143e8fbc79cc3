"""Evaluation of an agent on the held-out episodes.

Policies act deterministically. Each seed's start from the states of the seed's own block, which is
the same for every agent. Quantities of an episode are those of `jumping_ant.evaluation.measures`,
`return_<term>` for each term of a reward that has several, `length` [control steps], and `survived`
(1 if it reached its time limit, else 0). A state that is not finite ends its episode and is left
out of the measures.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import mujoco
import numpy as np
import pandas as pd
from mujoco.batch import Batch
from numpy.typing import NDArray

from jumping_ant.evaluation import episodes, motion, playing
from jumping_ant.evaluation.episodes import EPISODE_KEYS, PUBLISHED
from jumping_ant.evaluation.measures import TERM
from jumping_ant.params.model import Params
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.rollout import Episode, Play
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World

MIN_AIRBORNE_SECONDS = 0.1  # [s] off the ground that count as a jump


@dataclass(frozen=True)
class Evaluation:
    """What the versions of an agent's policies do in the held-out episodes."""

    episodes: pd.DataFrame  # of the published policies, seed by seed
    variants: pd.DataFrame  # means over episodes of each seed's variants, and how many they are
    median: Trajectory  # of the episode of median return, the lower one of an even number


def evaluate(
    world: World, params: Params, agent: str, versions: Mapping[int, Mapping[str, Policy]]
) -> Evaluation:
    """Play the held-out episodes of all versions of each seed's policy, and the median one again.

    Args:
        world: The robot and the task.
        params: All parameters.
        agent: The agent's name.
        versions: Versions of each seed's policy by name; one of them is `PUBLISHED`.
    """
    num_episodes = episodes.num_episodes(params.agent(agent), params.evaluate)
    keys: list[dict[str, Any]] = []
    plays: dict[int, list[Play]] = {seed: [] for seed in versions}
    for seed, policies in versions.items():
        for version, policy in policies.items():
            for number, start in enumerate(params.evaluate.block(seed)[: num_episodes[version]]):
                keys.append(
                    {"seed": seed, "variant": version, "episode": number, "episode_seed": start}
                )
                plays[seed].append(Play(policy, start))
    of_episode, workers = partial(measure, world), params.compute.workers
    measured = playing.play(world, agent, "held-out", plays, of_episode, workers)
    table = pd.DataFrame(key | values for key, values in zip(keys, measured, strict=True))
    is_published = table["variant"] == PUBLISHED
    published = table[is_published].drop(columns="variant").reset_index(drop=True)
    middle = published["return"].argsort(kind="stable").iloc[(len(published) - 1) // 2]
    seed, number = (int(published[name].iloc[middle]) for name in ("seed", "episode"))
    (played,) = rollout.run(world, versions[seed][PUBLISHED], [params.evaluate.block(seed)[number]])
    median = replay(world, played, agent, seed, number)
    groups = table[~is_published].groupby(["seed", "variant"], as_index=False, sort=False)
    variants = groups[_quantities(table)].mean()
    variants.insert(2, "episodes", groups.size()["size"])
    return Evaluation(published, variants, median)


def seed_means(table: pd.DataFrame) -> pd.DataFrame:
    """Return each seed's mean of every quantity over the episodes in which it is defined."""
    return table.groupby("seed", as_index=False)[_quantities(table)].mean()


def to_csv(agent: str, table: pd.DataFrame) -> str:
    """Return an agent's table as the content of a CSV file, in which each row names the agent."""
    named = table.assign(agent=agent)[["agent", *table]]
    return str(named.to_csv(index=False, lineterminator="\n"))


def summarize(table: pd.DataFrame) -> dict[str, float]:
    """Return the mean over seeds of every quantity that is defined in at least one episode."""
    means = seed_means(table)[_quantities(table)].mean().dropna()
    return {str(name): float(mean) for name, mean in means.items()}


def measure(world: World, episode: Episode) -> dict[str, float]:
    """Return the quantities of one episode."""
    dt = world.dt
    finite = np.isfinite(episode.qpos).all(axis=1) & np.isfinite(episode.qvel).all(axis=1)
    positions = np.concatenate([episode.start_qpos[None], episode.qpos[finite]])
    places = world.anatomy.places(positions)
    heights = places[:, 2]
    # Contacts are not recorded at the start, which counts as on the ground.
    airborne = np.concatenate([[False], episode.airborne[finite]])
    jumps = motion.phases(airborne, MIN_AIRBORNE_SECONDS / dt)
    change = np.diff(episode.torques, axis=0)
    terms = {f"{TERM}{name}": float(values.sum()) for name, values in episode.terms.items()}
    return {
        "length": len(episode.rewards),
        "return": episode.total(),
        **(terms if len(terms) > 1 else {}),
        "peak_height": float(heights.max()),
        "apex": motion.apex(heights, jumps),
        "mean_height": float(heights.mean()),
        "jumps": len(jumps),
        "airborne_seconds": float(airborne.sum() * dt),
        "flight": float(airborne.sum() / len(episode.rewards)),
        "torque_change": float(np.square(change).mean()) if len(change) else 0.0,
        "fluidity": motion.fluidity(joint_angles(world, positions), dt),
        "work": float(np.abs(motor_power(world, episode)[finite]).sum() * dt),
        "drift": float(np.hypot(*(places[-1, :2] - places[0, :2]))),
        "survived": int(not episode.terminated),
    }


def _quantities(table: pd.DataFrame) -> list[str]:
    """Return the columns of a table of episodes that measure something."""
    return [str(name) for name in table if name not in (*EPISODE_KEYS, "variant")]


def joint_angles(world: World, qpos: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return motor joints' angles over their ranges (unlimited: a full turn), (n, num_motors)."""
    model, joints = world.model, world.anatomy.motor_joints
    low, high = model.jnt_range[joints].T
    ranges = np.where(model.jnt_limited[joints] == 1, high - low, 2 * np.pi)
    return np.asarray(qpos[:, model.jnt_qposadr[joints]] / ranges)


def motor_power(world: World, episode: Episode) -> NDArray[np.float64]:
    """Return motor power [W] at each step's end, (T, num_motors); 0 if a velocity is not finite."""
    velocities = episode.qvel[:, world.model.jnt_dofadr[world.anatomy.motor_joints]]
    velocities = np.where(np.isfinite(velocities), velocities, 0.0)
    return episode.torques * world.anatomy.peak_torques * velocities


def replay(world: World, episode: Episode, agent: str, seed: int, number: int) -> Trajectory:
    """Simulate an episode of T control steps again, and keep all T * frame_skip + 1 states."""
    frame_skip = world.env.frame_skip
    batch = Batch(world.model, 1, 1)
    batch.reset(stage=mujoco.mjtStage.mjSTAGE_NONE)
    batch.bind("qpos")[0], batch.bind("qvel")[0] = episode.start_qpos, episode.start_qvel
    batch.forward()
    controls = episode.torques * world.anatomy.control_limits
    control = np.repeat(controls, frame_skip, axis=0)[None]
    states = batch.rollout(control.shape[1], control, record=("qpos", "qvel"))
    return Trajectory(
        qpos=np.concatenate([episode.start_qpos[None], states["qpos"][0]]),
        qvel=np.concatenate([episode.start_qvel[None], states["qvel"][0]]),
        torques=episode.torques,
        rewards=episode.rewards,
        terms=episode.terms,
        agent=agent,
        seed=seed,
        episode=number,
        episode_return=episode.total(),
        timestep=float(world.model.opt.timestep),
        frame_skip=frame_skip,
    )

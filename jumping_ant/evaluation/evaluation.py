"""Evaluation of an agent on the held-out episodes.

Every policy starts from the same states and acts deterministically. These quantities are measured
per episode:

| column | meaning | unit |
|---|---|---|
| length | control steps until the end | steps |
| return | sum of the rewards | |
| return_<term> | sum of a term of the reward, if the reward has several | |
| peak_height | highest torso height | m |
| apex | highest torso height in a jump, mean over jumps; without a jump, peak_height | m |
| mean_height | mean torso height | m |
| jumps | airborne phases of at least `min_airborne_seconds` | |
| airborne_seconds | time without any contact | s |
| flight | share of control steps that end without any contact, in [0, 1] | |
| torque_change | torque change: mean squared change of torque over peak torque, step to step | |
| fluidity | mean spectral arc length of joint velocities while moving; NaN if never moving | |
| work | mechanical work of the motors: sum of abs(torque x joint velocity) x dt | J |
| drift | horizontal distance of the torso from its start to its end | m |
| survived | 1 if the episode reached its time limit, else 0 | |

A state that is not finite ends its episode and is left out of the measures. Jumps and fluidity are
defined in `jumping_ant.evaluation.motion`.
"""

from typing import Any

import mujoco
import numpy as np
import pandas as pd
from mujoco.batch import Batch
from numpy.typing import NDArray

from jumping_ant.evaluation import motion
from jumping_ant.experiment.episodes import EPISODE_KEYS
from jumping_ant.looks.measures import TERM
from jumping_ant.params.blocks import EvaluateParams
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import rollout
from jumping_ant.sim.rollout import Episode
from jumping_ant.sim.trajectory import Trajectory
from jumping_ant.sim.world import World


def evaluate(
    world: World,
    settings: EvaluateParams,
    agent: str,
    policies: dict[int, Policy],
    num_threads: int = 1,
) -> tuple[pd.DataFrame, Trajectory]:
    """Return the held-out episodes of each seed's policy, and the trajectory of one of them.

    It is the episode of median return, the lower one of an even number.
    """
    table, episodes = _play(world, settings, policies, num_threads)
    median = int(table["return"].argsort(kind="stable").iloc[(len(table) - 1) // 2])
    row = table.iloc[median]
    played = episodes[median]
    return table, replay(world, played, agent, int(row["seed"]), int(row["episode"]))


def evaluate_variants(
    world: World,
    settings: EvaluateParams,
    published: tuple[dict[int, Policy], pd.DataFrame],
    variants: dict[int, dict[str, Policy]],
    num_threads: int = 1,
) -> pd.DataFrame:
    """Return the means over the held-out episodes of each seed's variants, a row for each.

    A variant that is the published policy itself is not run again: `published` has those policies,
    and their episodes as `evaluate` returns them.
    """
    policies, episodes = published
    rows = []
    for seed, own in variants.items():
        for name, policy in own.items():
            if policy is policies[seed]:
                table = episodes[episodes["seed"] == seed]
            else:
                table, _ = _play(world, settings, {seed: policy}, num_threads)
            rows.append(seed_means(table).assign(variant=name))
    table = pd.concat(rows, ignore_index=True)
    return table[["seed", "variant", *(name for name in table if name not in ("seed", "variant"))]]


def _play(
    world: World, settings: EvaluateParams, policies: dict[int, Policy], num_threads: int
) -> tuple[pd.DataFrame, list[Episode]]:
    """Run the held-out episodes of each seed's policy, the same policy once, and measure them."""
    episode_seeds = [settings.seed + i for i in range(settings.episodes)]
    rows: list[dict[str, Any]] = []
    episodes: list[Episode] = []
    played: dict[int, tuple[list[Episode], list[dict[str, float]]]] = {}
    for seed, policy in policies.items():
        if id(policy) not in played:
            ran = rollout.run(world, policy, episode_seeds, num_threads)
            measured = [measure(world, settings, episode) for episode in ran]
            played[id(policy)] = ran, measured
        ran, measured = played[id(policy)]
        for number, (episode_seed, measures) in enumerate(
            zip(episode_seeds, measured, strict=True)
        ):
            rows.append({"seed": seed, "episode": number, "episode_seed": episode_seed} | measures)
        episodes += ran
    return pd.DataFrame(rows), episodes


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


def measure(world: World, settings: EvaluateParams, episode: Episode) -> dict[str, float]:
    """Return the quantities of one episode (see the module's docstring)."""
    dt = world.dt
    finite = np.isfinite(episode.qpos).all(axis=1) & np.isfinite(episode.qvel).all(axis=1)
    positions = np.concatenate([episode.start_qpos[None], episode.qpos[finite]])
    places = world.anatomy.places(positions)
    heights = places[:, 2]
    # Contacts are not recorded at the start, which counts as on the ground.
    airborne = np.concatenate([[False], episode.airborne[finite]])
    jumps = motion.phases(airborne, settings.min_airborne_seconds / dt)
    change = np.diff(episode.torques, axis=0)
    return {
        "length": len(episode.rewards),
        "return": float(episode.rewards.sum()),
        **_returns_of_terms(episode),
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
    return [str(name) for name in table if name not in EPISODE_KEYS]


def _returns_of_terms(episode: Episode) -> dict[str, float]:
    """Return the sum of each term of the reward; empty if there is only one."""
    if len(episode.terms) < 2:
        return {}
    return {f"{TERM}{name}": float(values.sum()) for name, values in episode.terms.items()}


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
        episode_return=float(episode.rewards.sum()),
        timestep=float(world.model.opt.timestep),
        frame_skip=frame_skip,
    )

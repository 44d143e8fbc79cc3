"""What the page knows: robots, the task, agents with their policies, starts and perturbations."""

import hashlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from jumping_ant.agents import catalogue
from jumping_ant.agents.families import BASELINE
from jumping_ant.base.paths import Paths
from jumping_ant.base.tables import Table
from jumping_ant.evaluation import episodes
from jumping_ant.media import style
from jumping_ant.params.blocks import EnvParams
from jumping_ant.params.model import Params
from jumping_ant.play import policies
from jumping_ant.policies import trained_policy
from jumping_ant.sim import robot
from jumping_ant.sim.levels import LEVELS
from jumping_ant.sim.rewards import active
from jumping_ant.sim.task import Task
from jumping_ant.sim.world import World
from jumping_ant.training import curves

STARTS = 4  # held-out starts of each seed
ROOM = 12_000_000  # [bytes] of policies, so that the page stays below 25 MB

Policies = dict[tuple[str, int], dict[str, Any]]
"""The JSON of policies, by agent and seed."""


class Slider(NamedTuple):
    """A perturbation that one number sets: its name, and where the slider begins and ends."""

    usual: float  # without perturbation
    least: float | None = None  # the slider's other end, if it is not the usual
    step: float | None = None


SLIDERS = {
    "gravity": Slider(1.0, 0.0),
    "friction": Slider(1.0),
    "torso_mass": Slider(np.nan, 0.0),  # [kg] the robot's own
    "motor_strength": Slider(1.0),
    "action_delay": Slider(0.0, step=1.0),
    "observation_delay": Slider(0.0, step=1.0),
    "observation_noise": Slider(0.0),
    "damping": Slider(1.0),
    "slope": Slider(0.0),
    "push": Slider(0.0),
}


def policy(root: Path, agent: str, seed: int) -> dict[str, Any]:
    """Return the JSON of a seed's published policy, with its origin."""
    paths = Paths(root).agent(agent).seed(seed)
    network = policies.to_json(trained_policy.load(paths))
    sha256 = hashlib.sha256(paths.content(paths.policy)).hexdigest()
    return {"agent": agent, "seed": seed, "file": {"sha256": sha256}} | network


def all_policies(root: Path, params: Params) -> Policies:
    """Return policies by agent and seed: all champions, and as many others as there is room for."""
    order = {name: curves.best_first(root, name, params.seeds) for name in params.agents}
    included: Policies = {}
    taken = 0
    for rank in range(len(params.seeds)):
        row = {(name, own[rank]): policy(root, name, own[rank]) for name, own in order.items()}
        taken += len(json.dumps(list(row.values())))
        if rank and taken > ROOM:
            break
        included |= row
    return included


def build(root: Path, params: Params, included: Policies) -> dict[str, Any]:
    """Return what the page knows besides its policies, of which each agent's champion is first."""
    seeds: dict[str, list[int]] = {}
    for agent, seed in included:
        seeds.setdefault(agent, []).append(seed)
    kinds = sorted({params.agent(name).robot for name in params.agents})
    worlds = {kind: World(robot.read(root, kind), params.env) for kind in kinds}
    families = {name: catalogue.row(params.agent(name)).family for name in params.agents}
    drawn = style.looks(families)
    return {
        "format": policies.FORMAT,
        "name": Path(params.robot.source).stem.replace("_", " ").capitalize(),
        "robots": {kind: robot_to_json(own) for kind, own in worlds.items()},
        "task": task_to_json(params.env) | {"dt": worlds[kinds[0]].dt},
        "sliders": list(_sliders(worlds[kinds[0]])),
        "agents": {
            name: {
                "label": catalogue.label(name, params.agent(name).algorithm),
                "robot": params.agent(name).robot,
                "colour": drawn[name].colour,
                "learns": families[name] != BASELINE,
                "kind": included[name, own[0]]["kind"],
                "seeds": _seeds(
                    params,
                    worlds[params.agent(name).robot],
                    own,
                    episodes.read(root, params, name),
                ),
            }
            for name, own in seeds.items()
        },
    }


def start(world: World, episode_seed: int) -> dict[str, Any]:
    """Return the start state of a held-out episode, as the batched environment draws it."""
    generator, _ = gym.utils.seeding.np_random(episode_seed)
    qpos, qvel = Task(world).start_state(generator)
    return {"seed": episode_seed, "qpos": qpos.tolist(), "qvel": qvel.tolist()}


def _seeds(
    params: Params, world: World, seeds: Sequence[int], table: Table
) -> list[dict[str, Any]]:
    """Return seeds with their first held-out starts, and what was returned from them."""
    return [
        {
            "seed": seed,
            "starts": [
                start(world, number)
                | {"return": float(table["return"][row]), "length": int(table["length"][row])}
                for number, row in zip(
                    params.evaluate.block(seed)[:STARTS],
                    np.flatnonzero(table["seed"] == seed),
                    strict=False,
                )
            ],
        }
        for seed in seeds
    ]


def robot_to_json(world: World) -> dict[str, Any]:
    """Return a robot, and where the task finds what in its state (see `Anatomy`)."""
    anatomy, model = world.anatomy, world.model
    turned = anatomy.orientation
    return {
        "xml": world.xml,
        "torso": anatomy.torso,
        "num_horizontal": anatomy.num_horizontal,
        "height_address": anatomy.height_address,
        "height_offset": anatomy.height_offset,
        "orientation": [turned.start, turned.stop],
        "level": anatomy.level,
        "control_limits": anatomy.control_limits.tolist(),
        "motors": [model.actuator(index).name for index in range(model.nu)],
    }


def task_to_json(env: EnvParams) -> dict[str, Any]:
    """Return the task: limits of episodes, the terms of the reward that count, and commands."""
    limits = ("frame_skip", "max_episode_steps", "min_torso_height", "max_torso_height", "max_tilt")
    return {
        **{name: getattr(env, name) for name in limits},
        "reward": {name: getattr(env.reward, name).model_dump() for name in active(env.reward)},
        "commands": [list(row) for row in env.commands],
    }


def _sliders(world: World) -> Iterator[dict[str, Any]]:
    """Yield the perturbations of the robustness stage that one number sets, with their ranges."""
    for name, slider in SLIDERS.items():
        usual = slider.usual
        if name == "torso_mass":
            usual = float(world.model.body_mass[world.anatomy.torso])
        ends = [LEVELS[name].most, usual] + ([] if slider.least is None else [slider.least])
        unit, _, text = LEVELS[name].about.removeprefix("[").partition("] ")
        yield {
            "name": name,
            "label": name.replace("_", " ").capitalize(),
            "unit": "" if unit == "-" else unit,
            "about": text,
            "usual": usual,
            "low": min(ends),
            "high": max(ends),
            "step": slider.step or (max(ends) - min(ends)) / 100,
        }

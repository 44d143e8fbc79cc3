"""Watch a trained policy play in MuJoCo's viewer, in real time, until the window is closed.

Usage: python -m scripts.watch [AGENT] [--seed N] (`make watch AGENT=sac SEED=30`)

Without an agent it plays the learner that did best in validation; without a seed, that agent's
best. A seed plays its held-out episodes, as the evaluation does. Keys in the window: space pauses,
backspace starts the next episode, the right arrow takes the next seed.
"""

import os
import threading
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from copy import copy
from itertools import cycle
from pathlib import Path
from queue import Empty, SimpleQueue

import glfw
import mujoco
from gymnasium.vector import AutoresetMode
from mujoco import viewer

from jumping_ant.agents import catalogue
from jumping_ant.agents.families import BASELINE
from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.media import rendering
from jumping_ant.params import params_file
from jumping_ant.params.model import Params
from jumping_ant.policies import trained_policy
from jumping_ant.sim import robot, rollout
from jumping_ant.sim.vector import RobotVectorEnv
from jumping_ant.sim.world import World
from jumping_ant.training import curves

PAUSE, NEXT_EPISODE, NEXT_SEED = glfw.KEY_SPACE, glfw.KEY_BACKSPACE, glfw.KEY_RIGHT
ELSEWHERE = "open results/play.html in a browser instead (`dvc repro play` writes it)"
Keys = SimpleQueue[int]


def main() -> None:
    """Parse the command line and play."""
    parser = command_line.parser(__doc__)
    parser.add_argument("agent", nargs="?", help="its name in params.yaml")
    parser.add_argument("--seed", type=int, help="the seed that plays first")
    options, params = parser.parse_args(), params_file.load()
    watch(PROJECT_ROOT, params, *choose(PROJECT_ROOT, params, options.agent, options.seed))


def choose(
    root: Path, params: Params, agent: str | None, seed: int | None
) -> tuple[str, list[int]]:
    """Return an agent and its trained seeds, in the order in which they play.

    Raises:
        InputError: There is no such agent or no such policy; the message lists what is allowed.
    """
    if agent is not None:
        params.agent(agent)
    trained: dict[str, list[int]] = {}
    for name, block in params.agents.items():
        if name == agent or (agent is None and catalogue.row(block).family != BASELINE):
            paths = Paths(root).agent(name)
            seeds = [number for number in params.seeds if paths.seed(number).policy.is_file()]
            trained |= {name: curves.best_first(root, name, seeds)} if seeds else {}
    if not trained:
        command = "make repro" if agent is None else f"dvc repro train@{agent}"
        raise InputError(f"policies of {agent or 'learners'}: none yet; `{command}` trains them")
    best = max(trained, key=lambda name: curves.published_return(root, name, trained[name][0]))
    seeds = trained[best]
    if seed is not None and seed not in seeds:
        raise InputError(f"seed of {best}: given {seed}, allowed: {str(sorted(seeds))[1:-1]}")
    first = 0 if seed is None else seeds.index(seed)
    return best, seeds[first:] + seeds[:first]


def watch(root: Path, params: Params, agent: str, seeds: list[int]) -> None:
    """Play episodes in a window until it is closed, and print what each returns.

    Raises:
        InputError: No window opens, or a policy is missing or damaged.
    """
    world = World(robot.read(root, params.agent(agent).robot), params.env)
    envs = RobotVectorEnv(world, 1, autoreset_mode=AutoresetMode.DISABLED)
    model, data = copy(world.model), mujoco.MjData(world.model)  # the window's panels change these
    chosen, keys, key, due = cycle(seeds), Keys(), NEXT_SEED, 0.0
    with _window(model, data, keys) as window:
        # Until somebody turns it, the camera is that of films.
        view = rendering.VIEW
        window.cam.distance, window.cam.azimuth = view.distance, view.azimuth
        window.cam.elevation = view.elevation
        while window.is_running():
            if key == NEXT_SEED:
                seed = next(chosen)
                policy = trained_policy.load(Paths(root).agent(agent).seed(seed))
                episodes = cycle(enumerate(params.evaluate.block(seed)))
            number, episode_seed = next(episodes)
            observations, _ = envs.reset(seed=[episode_seed])
            policy.start([episode_seed])
            total, length = 0.0, 0
            for step in rollout.steps(envs, observations, policy.act, policy.actions.hold):
                envs.batch.get_data(0, data)
                mujoco.mj_forward(model, data)
                torso = data.xpos[world.anatomy.torso]
                window.cam.lookat[:] = rendering.camera_path(torso[None], params.record.fps)[0]
                window.sync()
                due = max(due + envs.dt, time.monotonic() + 0.001)  # lost time is not made up for
                key = _wait(window, keys, due)
                if key or not window.is_running():
                    break
                total, length = total + step.rewards[0], length + 1
            else:
                result = f"return {total:,.1f} in {length:,} steps"
                print(f"{agent}, seed {seed}, episode {number}: {result}", flush=True)


def _wait(window: viewer.Handle, keys: Keys, until: float) -> int:
    """Wait, longer after the pause key; return the key that ends the episode, or 0."""
    is_paused = False
    while window.is_running() and (is_paused or time.monotonic() < until):
        with suppress(Empty):
            key = keys.get(timeout=0.05 if is_paused else max(0.0, until - time.monotonic()))
            if key in (NEXT_EPISODE, NEXT_SEED):
                return key
            is_paused ^= key == PAUSE
    return 0


@contextmanager
def _window(model: mujoco.MjModel, data: mujoco.MjData, keys: Keys) -> Iterator[viewer.Handle]:
    """Open MuJoCo's viewer; close it at the end."""
    _check_display()
    before = set(threading.enumerate())
    try:
        window = viewer.launch_passive(
            model, data, key_callback=keys.put, show_left_ui=False, show_right_ui=False
        )
    except RuntimeError as error:  # on macOS, only `mjpython` opens it
        raise InputError(f"window: {error}; {ELSEWHERE}") from error
    try:
        yield window
    finally:
        window.close()
        for thread in set(threading.enumerate()) - before:
            thread.join()  # it still draws, and crashes if the program ends meanwhile


def _check_display() -> None:
    """Raise an InputError if no window opens here: MuJoCo's viewer would wait for ever."""
    with warnings.catch_warnings(action="ignore"):
        if glfw.init():
            glfw.window_hint(glfw.VISIBLE, glfw.FALSE)
            window = glfw.create_window(64, 64, "", None, None)
            glfw.default_window_hints()
            if window:
                return glfw.destroy_window(window)
        reason = os.fsdecode(glfw.get_error()[1] or "")
    raise InputError(f"display: no window opens here ({reason}); {ELSEWHERE}")


if __name__ == "__main__":
    with reported():
        main()

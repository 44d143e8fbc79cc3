"""Watch a trained policy play, in real time.

It plays in MuJoCo's window or, without a screen, in a Rerun viewer in a browser on this machine.
The episodes start like the held-out ones and continue until Ctrl-C.

Usage: python -m jumping_ant.watching.watch AGENT [--seed N] [--episodes N]
"""

import argparse
import os
import signal
import sys
import warnings
from contextlib import suppress
from pathlib import Path

import glfw
import mujoco
import numpy as np

from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import episodes, params_file
from jumping_ant.experiment.models import Params
from jumping_ant.policies import policy_file
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World
from jumping_ant.watching import server
from jumping_ant.watching.live import LiveRecording
from jumping_ant.watching.playing import play


def main() -> None:
    """Parse the command line and play."""
    parser = argparse.ArgumentParser(description="Watch a trained policy play.")
    parser.add_argument("agent", help="name of the agent in params.yaml")
    parser.add_argument("--seed", type=int, help="training seed of the policy; default: the best")
    parser.add_argument("--episodes", type=int, help="number of episodes; default: until Ctrl-C")
    options = parser.parse_args()
    settings = params_file.load()
    settings.agent(options.agent)
    if options.episodes is not None and options.episodes < 1:
        raise InputError(f"--episodes: given {options.episodes}, allowed: 1 or more")
    seed = options.seed
    if seed is None:
        seed = best_seed(PROJECT_ROOT, settings, options.agent)
    policy = load_policy(PROJECT_ROOT, options.agent, seed)
    name = f"{options.agent}, seed {seed}"
    show = _in_window if has_screen() else _in_browser
    world = World(robot.read(PROJECT_ROOT, settings.agent(options.agent).robot), settings.env)
    show(world, policy, name, settings.evaluate.block(seed).start, options.episodes)


def run() -> None:
    """Run `main`; an input error, a missing server, Ctrl-C or SIGTERM ends it with one line."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with reported():
            main()
    except KeyboardInterrupt:
        print("\nended", file=sys.stderr)  # on a line of its own, after the terminal's ^C


def best_seed(root: Path, params: Params, agent: str) -> int:
    """Return the seed whose policy has the highest return in the held-out episodes."""
    table = episodes.read_means(root, params, agent)
    return int(table["seed"][np.argmax(table["return"])])


def load_policy(root: Path, agent: str, seed: int) -> Policy:
    """Read a trained policy; an InputError lists the seeds that are trained."""
    paths = Paths(root).agent(agent)
    trained = sorted(
        int(path.parent.name.removeprefix("seed-"))
        for path in paths.models.glob("seed-*/policy.zip")
    )
    if seed not in trained:
        allowed = ", ".join(map(str, trained)) or f"none yet; `dvc repro train@{agent}` trains them"
        raise InputError(f"seed of {agent}: given {seed}, allowed: {allowed}")
    return policy_file.load(paths.seed(seed).policy, (agent, seed))


def has_screen() -> bool:
    """Tell whether a window can open here."""
    names = ("DISPLAY", "WAYLAND_DISPLAY")
    return sys.platform != "linux" or any(os.environ.get(name) for name in names)


def _in_window(
    world: World, policy: Policy, name: str, first_seed: int, num_episodes: int | None
) -> None:
    """Play in a window; closing it also ends the program."""
    env = RobotEnv(world, render_mode="human")
    warnings.simplefilter("error", glfw.GLFWError)
    try:
        env.reset()
        print(f"{name}: plays in MuJoCo's window (Ctrl-C ends it)", flush=True)
        with suppress(glfw.GLFWError):  # from drawing into a window that was closed
            for _ in play(env, policy, first_seed, num_episodes):
                pass  # the environment draws itself
    except (glfw.GLFWError, mujoco.FatalError) as error:
        raise InputError(
            f"display: no window opens here ({error}); unset DISPLAY and WAYLAND_DISPLAY to watch "
            "in a browser"
        ) from error
    finally:
        warnings.simplefilter("ignore")  # warnings while a closed window is cleaned up


def _in_browser(
    world: World, policy: Policy, name: str, first_seed: int, num_episodes: int | None
) -> None:
    env = RobotEnv(world)
    with server.serve(name) as (stream, feed, address):
        print(f"{name}: open {address} (Ctrl-C ends it)", flush=True)
        recording = LiveRecording(stream, world)
        for step in play(env, policy, first_seed, num_episodes):
            recording.show(step)  # the first time with all that stays: shapes, styles, layout
            feed.publish()


if __name__ == "__main__":
    run()

"""Watch a trained policy play, in real time.

It plays in MuJoCo's window, where episodes follow each other until Ctrl-C; they start like the
held-out ones. Without a screen, it plays on the live page (docs/play.md) in a browser on this
machine, from which one chooses.

Usage: python -m jumping_ant.watching.watch AGENT [--seed N] [--episodes N]
"""

import argparse
import os
import signal
import sys
import warnings
from contextlib import suppress

import glfw
import mujoco

from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from jumping_ant.policies.policy import Policy
from jumping_ant.sim import robot
from jumping_ant.sim.env import RobotEnv
from jumping_ant.sim.world import World
from jumping_ant.watching import server, trained
from jumping_ant.watching.playing import play


def main() -> None:
    """Parse the command line and play."""
    parser = argparse.ArgumentParser(description="Watch a trained policy play.")
    parser.add_argument("agent", help="name of the agent in params.yaml")
    parser.add_argument("--seed", type=int, help="training seed; default: the best in validation")
    parser.add_argument("--episodes", type=int, help="number in a window; default: until Ctrl-C")
    options = parser.parse_args()
    settings = params_file.load()
    settings.agent(options.agent)
    if options.episodes is not None and options.episodes < 1:
        raise InputError(f"--episodes: given {options.episodes}, allowed: 1 or more")
    if options.episodes is not None and not has_screen():
        raise InputError(
            f"--episodes: given {options.episodes}, allowed: none without a screen, where the page "
            "has a button for each"
        )
    there = trained.seeds(PROJECT_ROOT, settings, options.agent)
    seed = options.seed if options.seed is not None else [*there, *settings.seeds][0]
    policy = trained.load(PROJECT_ROOT, settings, options.agent, seed)
    if not has_screen():
        _in_browser(settings, options.agent, seed)
        return
    world = World(robot.read(PROJECT_ROOT, settings.agent(options.agent).robot), settings.env)
    name, first = f"{options.agent}, seed {seed}", settings.evaluate.block(seed).start
    _in_window(world, policy, name, first, options.episodes)


def run() -> None:
    """Run `main`; an input error, Ctrl-C or SIGTERM ends it with one line."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with reported():
            main()
    except KeyboardInterrupt:
        print("\nended", file=sys.stderr)  # on a line of its own, after the terminal's ^C


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


def _in_browser(params: Params, agent: str, seed: int) -> None:
    with server.listen(PROJECT_ROOT, params) as (serving, address):
        address += f"#a={agent}.{seed}.0"
        print(f"{agent}, seed {seed}: open {address} (Ctrl-C ends it)", flush=True)
        serving.serve_forever()


if __name__ == "__main__":
    run()

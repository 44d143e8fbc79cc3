"""Watch a trained policy play, in real time.

It plays in MuJoCo's window, or, where there is no screen, in a Rerun viewer in a browser on this
machine. The episodes start as the held-out ones do, and go on until Ctrl-C.

Usage: python -m jumping_ant.watch AGENT [--seed N] [--episodes N]
"""

import argparse
import itertools
import os
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import glfw
import mujoco
import numpy as np
from numpy.typing import NDArray

from jumping_ant import params, policies, robot, tables
from jumping_ant.env import JumpingAnt
from jumping_ant.errors import InputError, WorkerError
from jumping_ant.files import PROJECT_ROOT
from jumping_ant.params import Params
from jumping_ant.policies import Policy
from jumping_ant.recording import server
from jumping_ant.recording.live import LiveRecording


@dataclass(frozen=True)
class Step:
    """A control step that was played.

    Attributes:
        qpos: Positions at its start, shape (15,).
        qvel: Velocities at its start, shape (14,).
        torques: Torques over peak torques, shape (8,).
        reward: What it earned.
    """

    qpos: NDArray[np.float64]
    qvel: NDArray[np.float64]
    torques: NDArray[np.float64]
    reward: float


def main() -> None:
    """Play what the command line asks for."""
    parser = argparse.ArgumentParser(description="Watch a trained policy play.")
    parser.add_argument("agent", help="its name in params.yaml")
    parser.add_argument("--seed", type=int, help="which of its policies; default: the best")
    parser.add_argument("--episodes", type=int, help="how many; default: until Ctrl-C")
    options = parser.parse_args()
    settings = params.load()
    settings.agent(options.agent)
    if options.episodes is not None and options.episodes < 1:
        raise InputError(f"--episodes: given {options.episodes}, allowed: 1 or more")
    seed = best_seed(PROJECT_ROOT, options.agent) if options.seed is None else options.seed
    policy = load_policy(PROJECT_ROOT, options.agent, seed)
    name = f"{options.agent}, seed {seed}"
    show = _in_window if has_screen() else _in_browser
    show(robot.read(PROJECT_ROOT), settings, policy, name, options.episodes)


def run() -> None:
    """Run `main`; a mistake, a missing server, and Ctrl-C or SIGTERM each end in one line."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        main()
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    except WorkerError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        print("\nended", file=sys.stderr)  # on a line of its own, after the terminal's ^C


def best_seed(root: Path, agent: str) -> int:
    """Return the seed whose policy returned most in the held-out episodes.

    Raises:
        InputError: The agent has not been evaluated.
    """
    path = root / "results" / "seeds" / f"{agent}.csv"
    table = tables.read(path, ("seed", "return"), f"evaluate@{agent}")
    return int(table["seed"][np.argmax(table["return"])])


def load_policy(root: Path, agent: str, seed: int) -> Policy:
    """Read a trained policy.

    Raises:
        InputError: The seed is not trained; the message lists those that are.
    """
    folder = root / "models" / agent
    trained = sorted(
        int(path.parent.name.removeprefix("seed-")) for path in folder.glob("seed-*/policy.zip")
    )
    if seed not in trained:
        allowed = ", ".join(map(str, trained)) or f"none yet; `dvc repro train@{agent}` trains them"
        raise InputError(f"seed of {agent}: given {seed}, allowed: {allowed}")
    return policies.load_file(folder / f"seed-{seed}" / "policy.zip")


def has_screen() -> bool:
    """Tell whether a window can open here."""
    names = ("DISPLAY", "WAYLAND_DISPLAY")
    return sys.platform != "linux" or any(os.environ.get(name) for name in names)


def play(
    env: JumpingAnt, policy: Policy, first_seed: int, num_episodes: int | None
) -> Iterator[Step]:
    """Play episodes in real time.

    Args:
        env: Where the policy plays.
        policy: What acts.
        first_seed: Seed of the first episode; the others count up from it.
        num_episodes: How many; None goes on and on.

    Yields:
        Each control step, not before its time has passed.
    """
    numbers = itertools.count() if num_episodes is None else range(num_episodes)
    for number in numbers:
        earned, due = 0.0, time.monotonic()
        for step in _play_episode(env, policy, first_seed + number):
            yield step
            earned += step.reward
            due = max(due + env.dt, time.monotonic() - env.dt)  # what is late is not made up for
            time.sleep(max(0.0, due - time.monotonic()))
        print(f"episode {number}: return {earned:,.0f}", flush=True)


def _play_episode(env: JumpingAnt, policy: Policy, seed: int) -> Iterator[Step]:
    observation, _ = env.reset(seed=seed)
    policy.start([seed])
    has_ended = False
    while not has_ended:
        torques = policy.act(observation[None])[0]
        qpos, qvel = env.data.qpos.copy(), env.data.qvel.copy()
        observation, reward, terminated, truncated, _ = env.step(torques.astype(np.float32))
        has_ended = terminated or truncated
        yield Step(qpos, qvel, torques, reward)


def _in_window(
    xml: str, settings: Params, policy: Policy, name: str, num_episodes: int | None
) -> None:
    """Play in a window; closing it is an end too.

    Raises:
        InputError: No window opens.
    """
    env = JumpingAnt(xml, settings.env, render_mode="human")
    warnings.simplefilter("error", glfw.GLFWError)
    try:
        env.reset()
        print(f"{name}: plays in MuJoCo's window (Ctrl-C ends it)", flush=True)
        with suppress(glfw.GLFWError):  # from drawing into a window that was closed
            for _ in play(env, policy, settings.evaluate.seed, num_episodes):
                pass  # the environment draws itself
    except (glfw.GLFWError, mujoco.FatalError) as error:
        raise InputError(
            f"display: no window opens here ({error}); unset DISPLAY and WAYLAND_DISPLAY to watch "
            "in a browser"
        ) from error
    finally:
        warnings.simplefilter("ignore")  # what is said while a closed window is tidied up


def _in_browser(
    xml: str, settings: Params, policy: Policy, name: str, num_episodes: int | None
) -> None:
    env = JumpingAnt(xml, settings.env)
    with server.serve(name) as (stream, address):
        print(f"{name}: open {address} (Ctrl-C ends it)", flush=True)
        recording = LiveRecording(stream, env.model, settings.env.frame_skip)
        for step in play(env, policy, settings.evaluate.seed, num_episodes):
            recording.show(step.qpos, step.qvel, step.torques, step.reward)


if __name__ == "__main__":
    run()

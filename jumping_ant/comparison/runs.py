"""Anybody's runs: the returns of agents while they learn, from a table or TensorBoard's files."""

import io
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, get_args

import numpy as np
import pandas as pd

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.families import Family
from jumping_ant.base.errors import InputError, told
from jumping_ant.base.files import content
from jumping_ant.base.tables import LARGEST
from jumping_ant.comparison.results import AgentResults

COLUMNS = ("agent", "seed", "step", "return")
SECONDS = "seconds"  # a column that there may be
METRICS = ("eval/mean_reward", "rollout/ep_rew_mean")  # of Stable-Baselines3, the better one first
AGENT = r"[A-Za-z0-9][A-Za-z0-9_. -]{0,59}"
NAME = re.compile(r"(.*?)[/_. -]*(?:seed)?[/_. -]*(\d+)", re.IGNORECASE)  # DQN_1, sac/seed-3


class Row(NamedTuple):
    """An agent's return at a point of a training."""

    agent: str
    seed: int
    step: float
    value: float  # the return
    seconds: float  # of training so far; NaN where nobody knows


class _Unknown(AgentBlock):
    """The settings of an agent of which only learning curves are known."""

    @property
    def max_env_steps(self) -> int:
        """Return nothing: curves say what was trained."""
        return 0


@dataclass(frozen=True)
class _Runs(AgentResults):
    """An agent of which only learning curves are known; its name says what it is."""

    place: int = 0  # among the agents

    @property
    def family(self) -> Family:
        """Return a family whose colour the agent has."""
        families: tuple[Family, ...] = get_args(Family)[:-1]  # without baselines
        return families[self.place % len(families)]

    @property
    def label(self) -> str:
        """Return the agent's name."""
        return self.name


def from_csv(path: Path) -> list[Row]:
    """Read a table with the columns agent, seed, step and return, and seconds if it has them.

    Raises:
        InputError: It is no such table.
    """
    try:
        file = io.BytesIO(content(path))
        table = pd.read_csv(file, dtype={"agent": str}, keep_default_na=False)
        if missing := [name for name in COLUMNS if name not in table]:
            raise ValueError(f"given no column {missing[0]}, allowed: {', '.join(COLUMNS)}")
        is_name = table["agent"].str.fullmatch(AGENT)
        if not is_name.all():
            row = int(is_name.argmin())
            given = repr(table["agent"][row])[:40]
            raise ValueError(f"row {row + 1}, agent: given {given}, allowed: letters and digits")
        names = [*COLUMNS[1:], *({SECONDS} & {*table})]
        numbers = table[names].apply(pd.to_numeric, errors="coerce")
        fit = numbers.abs() < LARGEST
        if not fit.all(axis=None):
            row, column = (int(place[0]) for place in np.nonzero(~fit.to_numpy()))
            given = str(table[names].iat[row, column])[:40]
            raise ValueError(f"row {row + 1}, {names[column]}: given {given!r}, allowed: a number")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{path}: {' '.join(str(error).split())}") from error
    seconds = numbers[SECONDS] if SECONDS in numbers else np.full(len(table), np.nan)
    rows = zip(table["agent"], *(numbers[name] for name in COLUMNS[1:]), seconds, strict=True)
    return [Row(name, int(seed), *map(float, rest)) for name, seed, *rest in rows]


def from_tensorboard(folder: Path, metric: str = "") -> list[Row]:
    """Read a metric of all runs in a folder, each in one of its own, such as `DQN_1`.

    By default the metric is one of Stable-Baselines3's.

    Raises:
        InputError: There is no run with the metric, or TensorBoard is not installed.
    """
    try:
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
    except ModuleNotFoundError as error:
        line = f"{folder}: needs TensorBoard, {told(error)}; run: pip install tensorboard"
        raise InputError(line) from error
    rows = []
    for place in sorted({path.parent for path in folder.rglob("*.tfevents.*")}):
        agent, seed = parted(place.relative_to(folder).as_posix())
        events = EventAccumulator(str(place), {"scalars": 0}).Reload()
        tags = events.Tags()["scalars"]
        name = next((it for it in ([metric] if metric else METRICS) if it in tags), None)
        if name is None:
            given = metric or METRICS[0]
            raise InputError(f"{place}: given no {given}, allowed: {', '.join(tags)}")
        for event in events.Scalars(name):
            passed = event.wall_time - (events.FirstEventTimestamp() or 0.0)
            rows.append(Row(agent, seed, event.step, event.value, passed))
    if not rows:
        raise InputError(f"{folder}: given no TensorBoard files, allowed: a folder that has some")
    return rows


def parted(name: str) -> tuple[str, int]:
    """Return the agent and the seed that a run's name ends with, as in `DQN_1`."""
    match = NAME.fullmatch(name)
    if not match or not match[1]:
        raise InputError(f"run {name[:60]!r}: given no seed, allowed: an agent and a number, DQN_1")
    return match[1], int(match[2])


def results(rows: Iterable[Row]) -> dict[str, AgentResults]:
    """Return the agents of runs; what a seed returns is what its last row says.

    Raises:
        InputError: A seed has a step twice, or agents have different numbers of seeds, or one.
    """
    drawn: dict[str, dict[int, list[Row]]] = {}
    for row in rows:
        drawn.setdefault(row.agent, {}).setdefault(row.seed, []).append(row)
    if not drawn:
        raise InputError("runs: given none, allowed: two or more seeds of each agent")
    most = max(map(len, drawn.values()))
    agents: dict[str, AgentResults] = {}
    for place, (name, seeds) in enumerate(drawn.items()):
        if len(seeds) < 2 or len(seeds) < most:
            least = max(2, most)
            raise InputError(
                f"{name}: given {len(seeds)} seeds, allowed: {least}, as many of each agent; a run "
                "that failed counts with what it returned"
            )
        curves = {seed: _curve(name, seed, seeds[seed]) for seed in sorted(seeds)}
        last = [curve["evaluation_return_mean"][-1] for curve in curves.values()]
        block = _Unknown(algorithm=name, robot="edited")
        agents[name] = _Runs(name, block, {"return": np.array(last)}, curves, place=place)
    return agents


def _curve(agent: str, seed: int, rows: list[Row]) -> dict[str, np.ndarray]:
    rows.sort(key=lambda row: row.step)
    steps = np.array([row.step for row in rows])
    if (np.diff(steps) == 0).any():
        raise InputError(f"{agent}, seed {seed}: given a step twice, allowed: a return for each")
    seconds = np.array([row.seconds for row in rows])
    curve = {"env_steps": steps, "evaluation_return_mean": np.array([row.value for row in rows])}
    return curve if np.isnan(seconds).any() else curve | {"seconds": seconds}

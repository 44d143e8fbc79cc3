"""A population on hosts of one core: what a generation takes and moves, and a model of both.

A generation of n policies of T control steps on k cores takes

    step * T * n / k            episodes, on the core with most of them
    + serial * T * n + update   work of one core: observations put in order and summed, PGPE's step
    + call * (k - 1)            calls to the other cores, one after another
    + moved / bandwidth         what the others are sent and send, through one host's link

`step` is of one host and one population, `serial` and `update` are of generations whose episodes
are there already, `call` and `bandwidth` of parts that do nothing. All else is predicted. The hosts
share one machine: with more hosts than it has cores, episodes take longer in proportion, and with
several at work, by a factor that as many threads of one process have without a cluster.
"""

import math
import pickle
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.agents.algorithm import AgentBlock
from jumping_ant.agents.events import Progress
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.base import machine
from jumping_ant.compute.parts import Message, Result, Rows
from soak.generations import STEPS, job_of

FITTED = (1, 200)  # the hosts and the population that `step` is of
FAR = {1_000: (100,), 10_000: (100, 1_000)}  # populations, and cores that are not here
FAR_STEPS = 200  # as in params.yaml
FAR_BANDWIDTH = 1.25e9  # [bytes/s] 10 Gbit/s

Figures = dict[str, Any]


@dataclass(frozen=True)
class Model:
    """What a generation takes and moves (see above)."""

    step: float  # [s] on a core that works alone
    serial: float  # [s]
    update: float  # [s]
    call: float  # [s]
    bandwidth: float  # [bytes/s]
    down: float  # [bytes] to another core, for each of its policies
    back: float  # [bytes] from another core, for each of its policies
    up: float  # [bytes] from another core, for each of its policies' control steps
    real_cores: float  # of the machine that all hosts are on
    crowding: float  # factor on `step` where all of them work

    def moved(self, cores: int, population: int, steps: int) -> float:
        """Return the bytes of a generation."""
        others = population - -(-population // cores)
        return others * (self.down + self.back + self.up * steps)

    def seconds(self, cores: int, population: int, steps: int) -> dict[str, float]:
        """Return the seconds of a generation, part by part."""
        crowding = max(1.0, cores / self.real_cores) * (self.crowding if cores > 1 else 1.0)
        return {
            "episodes": self.step * crowding * steps * -(-population // cores),
            "serial": self.serial * steps * population + self.update,
            "calls": self.call * (cores - 1),
            "moves": self.moved(cores, population, steps) / self.bandwidth,
        }


@dataclass(frozen=True)
class Measured:
    """Generations of one population on some hosts."""

    hosts: int
    population: int
    seconds: float  # of the fastest generation: disturbances only add time
    moved: float  # [bytes] a generation, all that links carried
    policy: str  # digest


@dataclass(frozen=True)
class Rounds:
    """Seconds of rounds in which parts do nothing."""

    calls: Mapping[int, float]  # by the number of other cores
    full: float  # of one other core that sends bytes
    size: int  # [bytes] that it sends


def read(
    lines: Iterable[Figures], hosts: int, received: Callable[[], int]
) -> tuple[Rounds, list[Measured]]:
    """Return what `soak.generations` prints, with what workers have received at each line."""
    rounds = Rounds({}, 0.0, 0)
    measured = []
    seconds: list[float] = []
    moved: list[int] = []
    for line in lines:
        if "rounds" in line:
            calls = {int(count): own for count, own in line["rounds"].items()}
            rounds = Rounds(calls, line["full"], line["bytes"])
        elif "seconds" in line:
            seconds.append(line["seconds"])
            moved.append(received())
        else:
            fastest = min(after - before for before, after in pairwise(seconds))
            each = (moved[-1] - moved[0]) / (len(moved) - 1)
            own = Measured(hosts, line["population"], fastest, each, line["policy"])
            measured.append(own)
            seconds, moved = [], []
    return rounds, measured


class Recorded:
    """A part that works once, and gives the same results ever after."""

    def __init__(self, make: Callable[[], Any], size: int) -> None:
        self._part, self._size = make(), size
        self.message: Any = None
        self.results: list[Any] = []

    def map(
        self, function: Callable[[Any, Message], Result], message: Callable[[Rows], Message]
    ) -> list[Result]:
        """Return results, new ones the first time."""
        self.message = message(np.arange(self._size))
        self.results = self.results or [function(self._part, self.message)]
        return self.results


@dataclass(frozen=True)
class Alone:
    """A generation whose episodes are there already."""

    population: int
    seconds: float  # of the fastest generation
    down: float  # [bytes] of what a core is sent, for each policy
    back: float  # [bytes] of what it sends, for each policy
    up: float  # [bytes] of what it sends, for each policy's control step


def alone(root: Path, population: int) -> Alone:
    """Measure what one core does for all, and the size of messages."""
    made: list[Recorded] = []

    def spread(make: Callable[[], Any], size: int) -> Recorded:
        made.append(Recorded(make, size))
        return made[0]

    seconds = _fastest(replace(job_of(root, population), spread=spread))
    (episodes,) = made[0].results
    sizes = (len(pickle.dumps(own, protocol=5)) for own in (made[0].message, episodes))
    down, whole = (size / population for size in sizes)
    up = (episodes.alive.nbytes + episodes.seen.nbytes) / episodes.alive.size
    return Alone(population, seconds, down, whole - up * STEPS, up)


def crowding(root: Path) -> float:
    """Return how much slower each core of this machine is when all play one population."""
    job, cores = job_of(root, FITTED[1]), machine.num_cores()
    return cores * _fastest(replace(job, num_threads=cores)) / _fastest(job)


def _fastest(job: Job[AgentBlock]) -> float:
    """Return the seconds of the fastest generation of a training in this process."""
    events = trainer_of(job.agent)(job)
    ends = [time.perf_counter() for event in events if isinstance(event, Progress)]
    return float(np.diff(ends).min())


def fitted(
    rounds: Rounds, ones: Sequence[Alone], measured: Sequence[Measured], crowding: float
) -> Model:
    """Return the model."""
    sizes = np.array([one.population for one in ones])
    serial, update = np.polyfit(sizes, [one.seconds for one in ones], 1)
    largest = max(ones, key=lambda one: one.population)
    call, _ = np.polyfit(list(rounds.calls), list(rounds.calls.values()), 1)
    (of_one,) = (own for own in measured if (own.hosts, own.population) == FITTED)
    one_core = of_one.seconds - (update + serial * FITTED[1])
    return Model(
        step=one_core / FITTED[1] / STEPS,
        serial=serial / STEPS,
        update=max(update, 0.0),
        call=call,
        bandwidth=rounds.size / (rounds.full - rounds.calls[1]),
        down=largest.down,
        back=largest.back,
        up=largest.up,
        real_cores=machine.num_cores(),
        crowding=crowding,
    )


def figures(model: Model, measured: Sequence[Measured]) -> Figures:
    """Return what was measured, beside what the model says, and what it says of larger ones."""
    rows = []
    for own in measured:
        given = (own.hosts, own.population, STEPS)
        seconds, moved = sum(model.seconds(*given).values()), model.moved(*given)
        rows.append(
            {
                "hosts": own.hosts,
                "population": own.population,
                "seconds": round(own.seconds, 4),
                "predicted_seconds": round(seconds, 4),
                "steps_per_second": round(own.population * STEPS / own.seconds),
                "moved": round(own.moved),
                "predicted_moved": round(moved),
            }
        )
    parts = {"measured": rows, "predicted": predicted(model)}
    return {"episode_steps": STEPS, "model": asdict(model)} | parts


def predicted(model: Model) -> list[Figures]:
    """Return what the model says of populations on machines of their own, also on the fastest."""
    model = replace(model, bandwidth=FAR_BANDWIDTH, real_cores=math.inf, crowding=1.0)
    rows = []
    for population, counts in FAR.items():

        def seconds(cores: int, population: int = population) -> float:
            return sum(model.seconds(cores, population, FAR_STEPS).values())

        fastest = min(range(1, population + 1), key=seconds)
        for cores in sorted({*counts, fastest}):
            parts = model.seconds(cores, population, FAR_STEPS)
            rows.append(
                {
                    "cores": cores,
                    "is_fastest": cores == fastest,
                    "population": population,
                    "seconds": {name: round(own, 3) for name, own in parts.items()},
                    "speed_up": round(seconds(1) / seconds(cores)),
                    "moved": round(model.moved(cores, population, FAR_STEPS)),
                }
            )
    return rows


def table(figures: Figures) -> str:
    """Return the figures as tables of docs/cluster.md: measured beside predicted, and predicted."""
    lines = [
        "| hosts | population | generation [s] | predicted | steps/s | moved [kB] | predicted |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for own in figures["measured"]:
        cells = [
            f"{own['hosts']}",
            f"{own['population']:,}",
            f"{own['seconds']:.2f}",
            f"{own['predicted_seconds']:.2f}",
            f"{own['steps_per_second']:,}",
            f"{own['moved'] / 1e3:,.0f}",
            f"{own['predicted_moved'] / 1e3:,.0f}",
        ]
        lines.append(f"| {' | '.join(cells)} |")
    names = list(figures["predicted"][0]["seconds"])
    columns = ["cores", "population", *(f"{name} [s]" for name in names)]
    columns += ["moved [MB]", "times one core"]
    lines += ["", f"| {' | '.join(columns)} |", f"|{' --- |' * len(columns)}"]
    for own in figures["predicted"]:
        note = ", the fastest" if own["is_fastest"] else ""
        cells = [f"{own['cores']:,}{note}", f"{own['population']:,}"]
        cells += [f"{own['seconds'][name]:.2f}" for name in names]
        cells += [f"{own['moved'] / 1e6:,.0f}", f"{own['speed_up']:,}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"

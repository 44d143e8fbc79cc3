"""Every numeric setting at its bounds and beside them: it trains, or one line refuses it before.

Usage: python -m soak.bounds [--cases NUMBER] [--seed SEED]

Each case is an agent with few updates and one setting changed, in a process of its own, which may
use so much memory and so many seconds; one that still trains then is fine. The cases are drawn in
an order that the seed determines; by default all are tried.
"""

import math
import os
import random
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple

from pydantic import ValidationError

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.events import Progress
from jumping_ant.agents.imitation.demonstrations import Demonstrations, play
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.agents.kernels import use_portable_kernels
from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError
from jumping_ant.params import article
from jumping_ant.policies import policy_file
from jumping_ant.sim import robot
from jumping_ant.sim.world import World

SECONDS, BYTES = 6, 6 * 2**30  # for a case
TINY, HUGE = 1e-300, 10**9


class Case(NamedTuple):
    """A setting of an algorithm's example agent, and its value."""

    algorithm: str
    setting: str
    value: Any


def cases() -> Iterator[Case]:
    """Yield all cases: numbers, and numbers in lists."""
    for name, row in ALGORITHMS.items():
        for setting, schema in row.settings.model_json_schema()["properties"].items():
            for kind in (schema, *schema.get("anyOf", ())):
                for value in values(kind):
                    yield Case(name, setting, value)


def values(schema: dict[str, Any]) -> Iterator[Any]:
    """Yield the bounds of a number, those beside them, and values far from what is usual."""
    if schema.get("type") == "array":
        for value in values(schema.get("items", {})):
            yield [value]
            yield [value] * min(schema.get("maxItems", 3), 3)
    elif schema.get("type") == "integer":
        low, high = schema.get("minimum", 0), schema.get("maximum", HUGE)
        yield from sorted({low - 1, low, low + 1, high - 1, high, high + 1, 10_000})
    elif schema.get("type") == "number":
        low = schema.get("minimum", schema.get("exclusiveMinimum", -HUGE))
        high = schema.get("maximum", schema.get("exclusiveMaximum", HUGE))
        beside = [low, high, math.nextafter(low, high), math.nextafter(high, low)]
        yield from sorted({*map(float, beside), TINY, 1e-12, 0.5, 1.0})


@cache
def world() -> World:
    """Return the article's robot and task."""
    return World(robot.build(article.ROBOT), article.ENV)


@cache
def demonstrations() -> bytes:
    """Return some of a policy that has hardly been trained."""
    agent = ALGORITHMS["ars"].example_agent()
    *_, finished = trainer_of(agent)(Job(world(), agent, seed=0))
    expert = policy_file.parse(finished.policy)  # type: ignore[union-attr]
    played = play(world(), expert, expert, list(range(10)), 60, 0.25)
    return Demonstrations(played, finished.policy).to_bytes()  # type: ignore[union-attr]


def run(case: Case) -> str:
    """Train a case's agent; return what became of it."""
    example = ALGORITHMS[case.algorithm].example_agent()
    try:
        agent = type(example).model_validate(example.model_dump() | {case.setting: case.value})
    except ValidationError:
        return "refused"
    if agent.fault(world().env):
        return "refused"
    content = demonstrations() if agent.learns_from_demonstrations else None
    try:
        for event in trainer_of(agent)(Job(world(), agent, seed=0, demonstrations=content)):
            if isinstance(event, Progress) and not math.isfinite(event.env_steps):
                return "progress without number"
    except InputError as error:
        return "refused" if "\n" not in str(error) else f"refused in lines: {error}"
    return "trained"


def apart(case: Case) -> str:
    """Run a case in a process of its own, and return what became of it; a fault has a colon."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as said:
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
            warnings.simplefilter("ignore")  # libraries', of their own
            warnings.simplefilter("always", RuntimeWarning)
            result = run(case)
            print(result, flush=True)
            os._exit(0)
        deadline = time.monotonic() + SECONDS
        while not (ended := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < deadline:
            time.sleep(0.005)
        if is_slow := not ended[0]:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        said.seek(0)
        lines = [line for line in said.read().splitlines() if line.strip()]
    if is_slow:
        return f"fault: {lines[-1]}" if set(lines) - {"trained"} else "still trains"
    if ended[1] or len(lines) != 1 or lines[0] not in ("trained", "refused"):
        return f"fault: status {ended[1]}: {' | '.join(lines[-2:])[:300]}"
    return lines[0]


def main() -> None:
    """Parse the command line, try cases, and exit with 1 if one is at fault."""
    parser = command_line.parser(__doc__, "python -m soak.bounds")
    parser.add_argument("--cases", type=int, help="how many, by default all")
    parser.add_argument("--seed", type=int, default=random.randrange(10**6))
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    drawn = list(cases())
    random.Random(options.seed).shuffle(drawn)
    faults = tried(drawn[: options.cases])
    sys.exit(bool(faults))


def tried(drawn: list[Case]) -> list[str]:
    """Try cases, print and return the faults, and print what became of the others."""
    use_portable_kernels()
    _ = world().model, demonstrations()
    counts, faults = Counter[str](), []
    for number, case in enumerate(drawn, start=1):
        result = apart(case)
        if number % 100 == 0:
            print(number, dict(counts), flush=True)
        counts[result.partition(":")[0]] += 1
        if result.startswith("fault"):
            faults.append(f"{case.algorithm}.{case.setting} = {case.value!r}: {result}")
            print(faults[-1], flush=True)
    print(dict(counts), flush=True)
    return faults


if __name__ == "__main__":
    main()

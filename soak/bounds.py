"""Every numeric setting at its bounds and beside them: it trains, or one line refuses it before.

Usage: python -m soak.bounds [--cases NUMBER] [--seed SEED]

Each case is an algorithm's example agent with one setting changed, in a process of its own, which
may use so much memory and so many seconds; one that still trains then is fine. The seed, which is
printed, determines the order; by default all cases are tried.
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
from typing import Any

from pydantic import ValidationError

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.agents.job import Job, trainer_of
from jumping_ant.agents.kernels import use_portable_kernels
from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError
from jumping_ant.params import article
from jumping_ant.sim import robot
from jumping_ant.sim.world import World
from scripts import layers

SECONDS, BYTES = 6, 6 * 2**30  # for a case
FAR = (1e-300, 1e-12, 0.5, 1.0)  # other numbers to try
Case = tuple[str, str, Any]  # an algorithm, a setting and its value


def cases() -> Iterator[Case]:
    """Yield all cases: numbers, and lists of them."""
    for name, row in ALGORITHMS.items():
        for setting, schema in row.settings.model_json_schema()["properties"].items():
            for kind in (schema, *schema.get("anyOf", ())):
                yield from ((name, setting, value) for value in values(kind))


def values(schema: dict[str, Any]) -> Iterator[Any]:
    """Yield the bounds of a number, those beside them, and values far from what is usual."""
    low = schema.get("minimum", schema.get("exclusiveMinimum", 0))
    high = schema.get("maximum", schema.get("exclusiveMaximum", 10**9))
    if schema.get("type") == "array":
        yield from (
            [value] * length for value in values(schema.get("items", {})) for length in (1, 3)
        )
    elif schema.get("type") == "integer":
        yield from sorted({low - 1, low, low + 1, high - 1, high, high + 1, 10_000})
    elif schema.get("type") == "number":
        beside = (low, high, math.nextafter(low, high), math.nextafter(high, low))
        yield from sorted({*map(float, beside), *FAR})


@cache
def world() -> World:
    """Return the article's robot and task."""
    return World(robot.build(article.ROBOT), article.ENV)


def run(algorithm: str, setting: str, value: Any) -> str:
    """Train an agent; return what became of it."""
    example = ALGORITHMS[algorithm].example_agent()
    try:
        agent = type(example).model_validate(example.model_dump() | {setting: value})
    except ValidationError:
        return "refused"
    content = layers.demonstrations() if agent.learns_from_demonstrations else None
    try:
        if not agent.fault(world().env):
            list(trainer_of(agent)(Job(world(), agent, seed=0, demonstrations=content)))
            return "trained"
    except InputError as error:
        if "\n" in str(error):
            return f"refused in several lines: {error}"
    return "refused"


def apart(case: Case) -> str:
    """Run a case in a process of its own, and return what became of it, or its fault."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as said:
        child = os.fork()
        if child == 0:
            os.dup2(said.fileno(), 1)
            os.dup2(said.fileno(), 2)
            resource.setrlimit(resource.RLIMIT_AS, (BYTES, BYTES))
            warnings.simplefilter("ignore")  # libraries', of their own
            warnings.simplefilter("always", RuntimeWarning)
            print(run(*case), flush=True)
            os._exit(0)
        deadline = time.monotonic() + SECONDS
        while not (ended := os.waitpid(child, os.WNOHANG))[0] and time.monotonic() < deadline:
            time.sleep(0.005)
        if is_slow := not ended[0]:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        said.seek(0)
        lines = [line for line in said.read().splitlines() if line.strip()]
    if lines in (["trained"], ["refused"]) and not ended[1]:
        return lines[0]
    if is_slow and not lines:
        return "still trains"
    return f"fault: status {ended[1]}: {' | '.join(lines[-2:])[:300]}"


def main() -> None:
    """Parse the command line, try cases, and exit with 1 if one is at fault."""
    parser = command_line.parser(__doc__, "python -m soak.bounds")
    parser.add_argument("--cases", type=int, help="how many, by default all")
    parser.add_argument("--seed", type=int, default=random.randrange(10**6))
    options = parser.parse_args()
    print(f"seed {options.seed}", flush=True)
    drawn = list(cases())
    random.Random(options.seed).shuffle(drawn)
    use_portable_kernels()
    _ = world().model, layers.demonstrations()
    counts = Counter[str]()
    for number, case in enumerate(drawn[: options.cases], start=1):
        result = apart(case)
        counts[result.partition(":")[0]] += 1
        if result.startswith("fault"):
            print(*case, result, flush=True)
        if number % 100 == 0:
            print(number, dict(counts), flush=True)
    print(dict(counts))
    sys.exit(bool(counts["fault"]))


if __name__ == "__main__":
    main()

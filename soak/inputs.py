"""Bad input of every kind, given to the stages as a user would give it.

Each must end in lines that name the place and exit status 2, never in a traceback.
"""

import copy
import math
import random
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from jumping_ant.experiment.models import Params
from scripts.checkout import Checkout
from soak import project as projects

NOT_NUMBERS: list[Any] = ["fast", None, [1], {"a": 1}, True, math.nan, math.inf, -math.inf]
NOT_NAMES: list[Any] = [None, [], {}, 7.5, "no such thing"]
NOT_LISTS: list[Any] = [None, "x", {}, [], [[]], ["a"], [-1], [1.5], [math.nan]]
NOT_BLOCKS: list[Any] = [None, 5, "x", [1]]

Place = tuple[str, ...]
Content = dict[str, Any]


@dataclass
class Count:
    """Inputs tried, and those answered clearly."""

    tried: int = 0
    clear: int = 0


@dataclass(frozen=True)
class Fault:
    """A params file with one fault.

    Attributes:
        key: The faulty key, with dots.
        content: All parameters.
    """

    key: str
    content: Content


class Inputs:
    """Gives bad input to a project's stages.

    Args:
        project: A prepared throw-away copy, with everything trained and evaluated.
        generator: Decides which faults occur.
    """

    def __init__(self, project: Checkout, generator: random.Random) -> None:
        self.count = Count()
        self.unclear: list[str] = []  # what was given, and the answer
        self._project = project
        self._generator = generator
        faults = list(params_faults(projects.settings()))
        generator.shuffle(faults)
        self._faults = iter(faults)
        self.num_params_faults = len(faults)

    def try_params(self) -> bool:
        """Give one more faulty params file; return False if all were given."""
        fault = next(self._faults, None)
        if fault is None:
            return False
        path = self._project.folder / "params.yaml"
        before = path.read_text(encoding="utf-8")
        with path.open("w", encoding="utf-8") as file:
            YAML().dump(fault.content, file)
        self._expect("train", "sac", named=fault.key, given=f"params.yaml with {fault.key}")
        path.write_text(before, encoding="utf-8")
        return True

    def try_files(self) -> None:
        """Give each stage a damaged version of a file that it reads."""
        self._try_file("assets/edited.xml", "train", "dqn", named="robot XML")
        self._try_file("models/pgpe/seed-0/policy.zip", "evaluate", "pgpe", named="policy")
        self._try_file(
            "results/agents/pgpe/trajectory.npz", "record", "pgpe", named="trajectory.npz"
        )

    def try_another_robot(self) -> None:
        """Give the stages an episode of a robot with another number of joints."""
        path = self._project.folder / "assets" / "edited.xml"
        before = path.read_text(encoding="utf-8")
        lines = before.splitlines(keepends=True)
        joints = [number for number, line in enumerate(lines) if 'name="ankle_4"' in line]
        motors = [number for number, line in enumerate(lines) if 'joint="ankle_4"' in line]
        path.write_text(
            "".join(line for n, line in enumerate(lines) if n not in joints + motors),
            encoding="utf-8",
        )
        self._expect("record", "pgpe", named="trajector", given="an episode of another robot")
        self._expect("evaluate", "pgpe", named="env.commands", given="another robot")
        path.write_text(before, encoding="utf-8")

    def _try_file(self, name: str, *command: str, named: str) -> None:
        path = self._project.folder / name
        before = path.read_bytes()
        place = self._generator.randrange(len(before) - 100)
        kinds = {"truncated": before[:place], "text": b"not what it should be\n"}
        kind = self._generator.choice(list(kinds))
        path.unlink()  # DVC may have linked it
        path.write_bytes(kinds[kind])
        self._expect(*command, named=named, given=f"{name}, {kind} at {place}")
        path.write_bytes(before)

    def _expect(self, *command: str, named: str, given: str) -> None:
        """Run a stage, and count whether it refuses its input clearly."""
        stage, *arguments = command
        done = subprocess.run(
            [sys.executable, "-m", f"stages.{stage}", *arguments],
            cwd=self._project.folder,
            env=self._project.environment,
            encoding="utf-8",
            capture_output=True,
        )
        said = done.stderr.strip()
        is_clear = (
            done.returncode == 2
            and "Traceback" not in done.stdout + said
            and "error: " in said
            and named in said
        )
        self.count.tried += 1
        self.count.clear += is_clear
        if not is_clear:
            self.unclear.append(f"{given}: exit status {done.returncode}: {said[-2000:]}")


ENTRIES = ("agents", "demonstrations")  # blocks whose entries may be removed


def params_faults(settings: Params) -> Iterator[Fault]:
    """Yield parameters with one fault each: at every key every kind that can occur there."""
    content = settings.model_dump()
    schema = Params.model_json_schema()
    for place, value in _places(content):
        key = ".".join(place)
        for bad in _bad_values(value, _own_schema(schema, content, place)):
            changed = copy.deepcopy(content)
            _block(changed, place)[place[-1]] = bad
            yield Fault(key, changed)
        is_entry = len(place) == 2
        has_default = "default" in _own_schema(schema, content, place)
        if not (has_default or (is_entry and place[0] in ENTRIES)):
            missing = copy.deepcopy(content)
            del _block(missing, place)[place[-1]]
            yield Fault(key, missing)
        if not (is_entry and place[0] == "agents"):  # which may have any name
            unknown = copy.deepcopy(content)
            _block(unknown, place)[f"{place[-1]}x"] = value
            yield Fault(f"{key}x", unknown)


def _places(content: Content, inside: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Yield the place of each value, and the value."""
    for key, value in content.items():
        yield (*inside, key), value
        if isinstance(value, dict):
            yield from _places(value, (*inside, key))


def _block(content: Content, place: Place) -> Content:
    block: Content = reduce(lambda outer, name: outer[name], place[:-1], content)
    return block


def _bad_values(value: Any, schema: Content) -> list[Any]:
    """Return values that are invalid in the place of a value."""
    members = schema.get("anyOf", [schema])
    bad = _bad_values_of_a_kind(value, members[0])
    return [one for one in bad if one is not None or {"type": "null"} not in members]


def _bad_values_of_a_kind(value: Any, schema: Content) -> list[Any]:
    """Return the same, null included; for null the schema says which values are valid."""
    kind = schema.get("type")
    if isinstance(value, bool):
        return [None, "yes", 2, [], {}]
    if isinstance(value, int) or (value is None and kind == "integer"):
        return [*NOT_NUMBERS, 1.5, *_out_of_range(schema)]
    if isinstance(value, float) or (value is None and kind == "number"):
        return [*NOT_NUMBERS, *_out_of_range(schema)]
    if isinstance(value, str):
        return NOT_NAMES[:-2] + NOT_NAMES[-1:]
    return NOT_LISTS if isinstance(value, list) else NOT_BLOCKS


def _out_of_range(schema: Content) -> list[float]:
    """Return numbers outside of a schema's bounds."""
    wrong = []
    if "minimum" in schema:
        wrong += [schema["minimum"] - 1, -(10**12)]
    if "exclusiveMinimum" in schema:
        wrong += [schema["exclusiveMinimum"], -1e-9]
    if "maximum" in schema:
        wrong += [schema["maximum"] + 1, 10**12]
    if "exclusiveMaximum" in schema:
        wrong += [schema["exclusiveMaximum"], 1e300]
    if "multipleOf" in schema:
        wrong += [schema["multipleOf"] * 50 + 1]
    return wrong


def _own_schema(schema: Content, content: Content, place: Place) -> Content:
    """Return the part of the schema that describes a place, {} if no single part does."""
    part = schema
    for key in place:
        part = _resolved(schema, next(iter(part.get("anyOf", [part]))))
        if "discriminator" in part:
            algorithm = content["agents"][place[1]]["algorithm"]
            part = _resolved(schema, {"$ref": part["discriminator"]["mapping"][algorithm]})
        names_alike = next(iter(part.get("patternProperties", {}).values()), None)
        others = names_alike or part.get("additionalProperties")
        inside = part.get("properties", {}).get(key, others)
        part = inside if isinstance(inside, dict) else {}
    return _resolved(schema, part)


def _resolved(schema: Content, part: Content) -> Content:
    if "$ref" not in part:
        return part
    name = Path(part["$ref"]).name
    resolved: Content = schema["$defs"][name]
    return resolved

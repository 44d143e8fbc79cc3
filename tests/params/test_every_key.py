"""At every key of `params.yaml`, values of a wrong kind are refused by the key's name."""

import copy
import math
from collections.abc import Iterator
from functools import reduce
from typing import Any

from jumping_ant.base.errors import InputError
from jumping_ant.params import params_file, presets

NOT_NUMBERS = ["fast", [1], {"a": 1}, True, math.nan, math.inf, -math.inf, -(10.0**20), 10.0**20]
WRONG: dict[type, list[Any]] = {
    bool: ["yes", 2, [], {}],
    int: [*NOT_NUMBERS, 1.5],
    float: NOT_NUMBERS,
    str: [[], {}, "no such thing"],
    list: ["x", {}, ["a"], [math.nan]],
    dict: [5, "x", [1]],
    type(None): ["fast", [math.nan], True],
}
ENTRIES = ("agents", "demonstrations")  # blocks whose entries may be removed, and have any name
CONTENT = presets.load("families").model_dump(exclude_unset=True)

Place = tuple[str, ...]


def test_every_wrong_value_is_refused_by_the_name_of_its_key() -> None:
    tried, accepted = 0, []
    for place, entries in faults():
        tried += 1
        content = copy.deepcopy(CONTENT)
        reduce(lambda outer, name: outer[name], place[:-1], content).update(entries)
        key, block = ".".join(place), ".".join(place[:-1])
        unknown = f"params.yaml: {block + ': ' * bool(block)}unknown key {place[-1]!r}"
        try:
            params_file.check(content)
        except InputError as error:
            said = str(error)
            assert f"params.yaml: {key}" in said or said.startswith(unknown), (key, said)
        else:
            accepted.append(key)
    assert tried > 1000 and accepted == []


def faults(block: Any = CONTENT, inside: Place = ()) -> Iterator[tuple[Place, dict[str, Any]]]:
    """Yield places and an entry at each that is wrong there, or unknown."""
    for key, value in block.items():
        place = (*inside, key)
        for wrong in WRONG[type(value)]:
            yield place, {key: wrong}
        if inside[:1] != ("agents",) or len(inside) > 1:
            yield (*inside, f"{key}x"), {f"{key}x": value}
        if isinstance(value, dict):
            yield from faults(value, place)


def test_what_has_no_default_must_be_given() -> None:
    for place in [(key,) for key in CONTENT] + [("env", key) for key in CONTENT["env"]]:
        content = copy.deepcopy(CONTENT)
        del reduce(lambda outer, name: outer[name], place[:-1], content)[place[-1]]
        try:
            params_file.check(content)
        except InputError as error:
            assert str(error) == f"params.yaml: {'.'.join(place)}: Field required"
        else:
            raise AssertionError(place)

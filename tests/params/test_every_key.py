"""At every key of `params.yaml`, every kind of wrong value is refused by the key's name."""

import copy
import math
from collections.abc import Iterator
from functools import reduce
from pathlib import Path
from typing import Any

from jumping_ant.base.errors import InputError
from jumping_ant.params import params_file, presets
from jumping_ant.params.model import Params

NOT_NUMBERS = ["fast", None, [1], {"a": 1}, True, math.nan, math.inf, -math.inf]
WRONG: dict[type, list[Any]] = {
    bool: [None, "yes", 2, [], {}],
    int: [*NOT_NUMBERS, 1.5],
    float: NOT_NUMBERS,
    str: [None, [], {}, "no such thing"],
    list: [None, "x", {}, [], [[]], ["a"], [-1], [1.5], [math.nan]],
    dict: [None, 5, "x", [1]],
}
KINDS = {"integer": int, "number": float}  # of values that may be null
ENTRIES = ("agents", "demonstrations")  # blocks whose entries may be removed
CONTENT = presets.load("families").model_dump()
SCHEMA = Params.model_json_schema()

Place = tuple[str, ...]
Schema = dict[str, Any]


def test_every_wrong_value_is_refused_by_the_name_of_its_key() -> None:
    tried, accepted = 0, []
    for key, content in faults():
        tried += 1
        try:
            params_file.check(content)
        except InputError as error:
            assert f"params.yaml: {key}" in str(error), (key, str(error))
        else:
            accepted.append(key)
    assert tried > 1000 and accepted == []


def faults() -> Iterator[tuple[str, Any]]:
    """Yield parameters with one fault each, and the faulty key."""
    for place, value in places(CONTENT):
        key, schema = ".".join(place), own_schema(place)
        is_entry = len(place) == 2 and place[0] in ENTRIES
        for bad in wrong_values(value, schema):
            yield key, changed(place, {place[-1]: bad})
        if "default" not in schema and not is_entry:
            yield key, changed(place, {}, missing=place[-1])
        if not (is_entry and place[0] == "agents"):  # which may have any name
            yield f"{key}x", changed(place, {f"{place[-1]}x": value})


def places(content: Schema, inside: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Yield the place of each value, and the value."""
    for key, value in content.items():
        yield (*inside, key), value
        if isinstance(value, dict):
            yield from places(value, (*inside, key))


def changed(place: Place, entries: Schema, missing: str | None = None) -> Schema:
    """Return all parameters with other entries in the block that a place is in."""
    content = copy.deepcopy(CONTENT)
    block = reduce(lambda outer, name: outer[name], place[:-1], content)
    block.update(entries)
    block.pop(missing, None)
    return content


def wrong_values(value: Any, schema: Schema) -> list[Any]:
    """Return values that are invalid in the place of a value."""
    members = schema.get("anyOf", [schema])
    kind = KINDS[members[0]["type"]] if value is None else type(value)
    wrong = WRONG[kind] + (out_of_range(members[0]) if kind in (int, float) else [])
    if kind is list:
        wrong = [one for one in wrong if not is_list_of(members[0], one)]
    return [one for one in wrong if one is not None or {"type": "null"} not in members]


def is_list_of(schema: Schema, value: Any) -> bool:
    """Return whether a value is a list that a schema of numbers allows: none, or one of them."""
    items = schema.get("items", {})
    if value == []:
        return "minItems" not in schema
    most = min(items.get("maximum", math.inf), items.get("exclusiveMaximum", math.inf))
    return bool(value == [1.5] and items.get("type") == "number" and most > 1.5)


def out_of_range(schema: Schema) -> list[float]:
    """Return numbers outside of a schema's bounds."""
    beyond = {
        "minimum": lambda bound: [bound - 1, -(10**12)],
        "exclusiveMinimum": lambda bound: [bound, -1e-9],
        "maximum": lambda bound: [bound + 1, 10**12],
        "exclusiveMaximum": lambda bound: [bound, 1e300],
        "multipleOf": lambda number: [number * 50 + 1],
    }
    return [wrong for name in beyond if name in schema for wrong in beyond[name](schema[name])]


def own_schema(place: Place) -> Schema:
    """Return the part of the schema that describes a place, {} if no single part does."""
    part = SCHEMA
    for key in place:
        part = resolved(part.get("anyOf", [part])[0])
        if "discriminator" in part:
            algorithm = CONTENT["agents"][place[1]]["algorithm"]
            part = resolved({"$ref": part["discriminator"]["mapping"][algorithm]})
        alike = next(iter(part.get("patternProperties", {}).values()), None)
        inside = part.get("properties", {}).get(key, alike or part.get("additionalProperties"))
        part = inside if isinstance(inside, dict) else {}
    return resolved(part)


def resolved(part: Schema) -> Schema:
    return SCHEMA["$defs"][Path(part["$ref"]).name] if "$ref" in part else part

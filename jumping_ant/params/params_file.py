"""Read and check all of `params.yaml` before any work starts.

YAML is read as version 1.2, as DVC reads it: `3e-4` is a number.
"""

import copy
import functools
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import YAMLError

from jumping_ant.base.errors import InputError, told
from jumping_ant.base.files import CODE_ROOT, PROJECT_ROOT, regular
from jumping_ant.params.model import Params

# The default parameters: those of the checkout, or those included in the wheel.
DEFAULTS = CODE_ROOT / "params.yaml"
if not DEFAULTS.is_file():
    DEFAULTS = CODE_ROOT / "jumping_ant" / "defaults" / "params.yaml"

MOST_CHARACTERS = 200_000  # of a params file, read in seconds; the default has some 12,000
MOST_VALUES = 100_000  # of a params file; the default has some 300

# Messages of pydantic that say what was given, or where a whole block was.
COMPLETE = ("missing", "value_error", "union_tag_invalid", "union_tag_not_found")

Model = TypeVar("Model", bound=BaseModel)


class _Constructor(SafeConstructor):
    """Refuses merge keys, which copy what they name, and so may double it in each line."""

    def flatten_mapping(self, node: Any) -> Any:
        """Do nothing, if there is nothing to merge."""
        if any(key.tag.endswith(":merge") for key, _ in node.value):
            raise YAMLError(f"merge keys (<<) in line {node.start_mark.line + 1}")


def load(path: Path = PROJECT_ROOT / "params.yaml") -> Params:
    """Read and check a params file; an InputError has a line for each error."""
    return check(read(path), path.name)


def read(path: Path) -> Any:
    """Read a params file without checking what it holds."""
    try:
        with regular(path) as file:
            text = file.read(4 * MOST_CHARACTERS).decode()
        if len(text) > MOST_CHARACTERS:
            raise InputError(f"{path.name}: given more, allowed: {MOST_CHARACTERS:,} characters")
        content = parse(text)
        num_values = _num_values(content, {})
    except OSError as error:
        raise InputError(f"{path.name}: {error.strerror}: {path}") from error
    except (YAMLError, UnicodeError, RecursionError) as error:  # the last for depth
        raise InputError(f"{path.name}: not YAML: {' '.join(str(error).split())}") from error
    if num_values > MOST_VALUES:
        given = f"{num_values:.3g} values, aliases counted as what their anchors hold"
        raise InputError(f"{path.name}: given {given}, allowed: {MOST_VALUES:,}")
    return content


def parse(text: str) -> Any:
    """Return what YAML text holds, or raise YAMLError, or RecursionError if it is too deep."""
    return copy.deepcopy(_parsed(text))


@functools.lru_cache(maxsize=4)  # a stage reads its files at its beginning and its end
def _parsed(text: str) -> Any:
    yaml = YAML(typ="safe", pure=True)  # depth would crash the parser in C
    yaml.Constructor = _Constructor
    try:
        return yaml.load(text)
    except (ValueError, TypeError, LookupError, AttributeError, OverflowError) as error:
        said = str(error) if isinstance(error, ValueError) else told(error)
        raise YAMLError(said) from error  # an odd scalar, such as the 45th day of a month


def check(content: Any, where: str = "params.yaml") -> Params:
    """Check params given as plain dictionaries and lists; an InputError has a line per error."""
    return validated(Params, content, where)


def validated(kind: type[Model], content: Any, where: str) -> Model:
    """Return a model of what a file holds; an InputError has a line for each error."""
    try:
        return kind.model_validate(content)
    except ValidationError as error:
        lines = [f"{where}: {_line(detail)}" for detail in error.errors()]
        raise InputError("\n".join(" ".join(line.splitlines()) for line in lines)) from error


def _num_values(content: Any, known: dict[int, int]) -> int:
    """Count the values of nested lists and dictionaries, shared ones as often as they occur."""
    if not isinstance(content, dict | list):
        return 1
    if id(content) not in known:
        inside = content.values() if isinstance(content, dict) else content
        known[id(content)] = 1 + sum(_num_values(value, known) for value in inside)
    return known[id(content)]


def _line(error: ErrorDetails) -> str:
    place = [str(part) for part in error["loc"] if part != "[key]"]
    if place[:1] == ["agents"]:
        del place[2:3]  # the algorithm, which pydantic puts between an agent and its keys
    if error["type"].startswith("union_tag"):
        place.append("algorithm")
    message = error["msg"].removeprefix("Value error, ")
    if error["type"] == "value_error" and not place:
        return message  # names its keys
    value = "" if error["type"] in COMPLETE else f", given {_show(error['input'])}"
    return f"{'.'.join(place) or 'the file'}: {message}{value}"


def _show(value: Any) -> str:
    try:
        shown = repr(value)
    except ValueError:  # Python does not print integers of thousands of digits
        shown = "a number too long to show"
    return shown if len(shown) <= 60 else shown[:57] + "..."

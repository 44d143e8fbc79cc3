"""Read and check all of `params.yaml` before any work starts.

Unknown keys, wrong types and values out of range (see `jumping_ant.params.blocks`) are
rejected with one line each that names the key, what was given and what is allowed.

YAML is read as version 1.2, as DVC reads it: `3e-4` is a number.
"""

import difflib
import re
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pydantic import ValidationError
from pydantic_core import ErrorDetails
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from jumping_ant.agents.catalogue import ALGORITHMS
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import CODE_ROOT, PROJECT_ROOT
from jumping_ant.params.blocks import Block
from jumping_ant.params.model import Params

# The default parameters: those of the checkout, or those included in the wheel.
DEFAULTS = CODE_ROOT / "params.yaml"
if not DEFAULTS.is_file():
    DEFAULTS = CODE_ROOT / "jumping_ant" / "defaults" / "params.yaml"

MOST_CHARACTERS = 200_000  # of a params file, read in seconds; the default has some 12,000
MOST_VALUES = 100_000  # of a params file; the default has some 300

# What is allowed, for errors where pydantic's own message addresses programmers.
ALLOWED = {
    "bool_type": "true or false",
    "dict_type": "a block of keys",
    "invalid_key": "names as keys",
    "model_attributes_type": "a block of keys",
    "model_type": "a block of keys",
    "string_pattern_mismatch": "lower-case letters, digits, _ and -, the first a letter or digit",
    "string_too_long": "at most {max_length} characters",
    "string_type": "a name",
    "too_long": "at most {max_length}",
    "too_short": "at least one",
}

INVALID_KEY = "[key]"


def load(path: Path = PROJECT_ROOT / "params.yaml") -> Params:
    """Read and check a params file.

    Raises:
        InputError: The file is missing, is not YAML, or does not fit the models; a line per error.
    """
    return check(read(path), path.name)


def read(path: Path) -> Any:
    """Read a params file without checking what it holds."""
    try:
        with path.open(encoding="utf-8") as file:
            text = file.read(MOST_CHARACTERS + 1)
        if len(text) > MOST_CHARACTERS:
            raise InputError(f"{path.name}: given more, allowed: {MOST_CHARACTERS:,} characters")
        content = parse(text)
        num_values = _num_values(content, {})
    except OSError as error:
        raise InputError(f"{path.name}: {error.strerror}: {path}") from error
    except (YAMLError, UnicodeError, RecursionError) as error:  # the last for depth
        raise InputError(f"{path.name}: not YAML: {' '.join(str(error).split())}") from error
    if num_values > MOST_VALUES:
        raise InputError(
            f"{path.name}: given {num_values:.3g} values, allowed: {MOST_VALUES:,}; each alias of "
            "an anchor counts as all that the anchor holds"
        )
    return content


def parse(text: str) -> Any:
    """Return what YAML text holds, or raise YAMLError, or RecursionError if it is too deep."""
    try:
        return YAML(typ="safe", pure=True).load(text)  # depth would crash the parser in C
    except ValueError as error:  # an odd scalar, such as the 45th day of a month
        raise YAMLError(str(error)) from error


def _num_values(content: Any, known: dict[int, int]) -> int:
    """Count the values of nested lists and dictionaries, shared ones as often as they occur."""
    if not isinstance(content, dict | list):
        return 1
    if id(content) not in known:
        inside = content.values() if isinstance(content, dict) else content
        known[id(content)] = 1 + sum(_num_values(value, known) for value in inside)
    return known[id(content)]


def check(content: Any, where: str = "params.yaml") -> Params:
    """Check params given as plain dictionaries and lists; an InputError has a line per error."""
    try:
        return Params.model_validate(content)
    except ValidationError as error:
        faults: dict[str, list[str]] = {}  # each member of a union reports the same fault
        for detail in error.errors():
            fault, allowed = _explain(detail)
            faults.setdefault(fault, []).append(allowed)
        texts = [f"{where}: {fault}{' or '.join(allowed)}" for fault, allowed in faults.items()]
        lines = [" ".join(text.splitlines()) for text in texts]  # a key may hold a line break
        raise InputError("\n".join(lines)) from error


def _explain(error: ErrorDetails) -> tuple[str, str]:
    """Return a validation error as two texts: the key and what was given; what is allowed."""
    parts, kind = _resolve(error["loc"])
    key = ".".join(map(str, parts)) or "the file"
    if error["type"] == "extra_forbidden":
        names = list(_bare(_resolve(error["loc"][:-1])[1]).model_fields)
        close = difflib.get_close_matches(str(parts[-1]), names, n=1)
        hint = f" (did you mean {close[0]!r}?)" if close else ""
        return f"{key}: unknown key{hint}; allowed: ", ", ".join(names)
    if error["type"] == "missing":
        return f"{key}: missing; it must be given", ""
    if error["type"] == "union_tag_invalid":
        given = _show(error["input"].get("algorithm"))
        return f"{key}.algorithm: given {given}, allowed: ", ", ".join(ALGORITHMS)
    if error["type"] == "union_tag_not_found":
        return f"{key}.algorithm: missing; allowed: ", ", ".join(ALGORITHMS)
    if error["type"] == "value_error":
        message = error["msg"].removeprefix("Value error, ")
        names_its_key = not parts and re.match(r"[\w.-]+: given ", message)
        return message if names_its_key else f"{key}: {message}", ""
    plain = error["msg"].removeprefix("Input should be ").removeprefix("a valid ")
    allowed = ALLOWED.get(error["type"], "{plain}").format(plain=plain, **error.get("ctx", {}))
    if type(None) in get_args(kind):
        allowed += " or null"
    return f"{key}: given {_show(error['input'])}, allowed: ", allowed


def _bare(kind: Any) -> Any:
    """Return a type without its `Annotated` metadata and without an alternative None."""
    members = [member for member in get_args(kind) if member is not type(None)]
    if type(None) in get_args(kind) and len(members) == 1:
        return _bare(members[0])
    return get_args(kind)[0] if get_origin(kind) is Annotated else kind


def _show(given: Any) -> str:
    """Return the text of a value, truncated if it is long."""
    try:
        shown = repr(given)
    except ValueError:  # Python does not print integers of thousands of digits
        shown = "a number too long to show"
    return shown if len(shown) <= 60 else shown[:57] + "..."


def _resolve(location: tuple[int | str, ...]) -> tuple[list[int | str], Any]:
    """Return the file's keys at a validation error's location, and the type expected there.

    Pydantic inserts its own names between the file's keys: the tag of an agent's block, the member
    of a union that reports the error, and `INVALID_KEY` if a key itself is invalid.
    """
    keys: list[int | str] = []
    kind: Any = Params
    for part in location:
        if part == INVALID_KEY:
            break
        kind = _bare(kind)
        if isinstance(kind, type) and issubclass(kind, Block):
            keys.append(part)
            field = kind.model_fields.get(str(part))
            kind = field.annotation if field else None
        elif get_origin(kind) in (dict, list):
            keys.append(part)
            kind = get_args(kind)[-1]
        else:
            row = ALGORITHMS.get(str(part))
            kind = row.settings if row else None
    return keys, kind

"""Presets: lists of overrides of `params.yaml`, in `presets/`.

`dvc exp run $(cat presets/NAME)` runs one of them in place; `load` returns the same parameters. As
in Hydra, `+key=value` adds a new key, and `~key` removes one.
"""

import re
import shlex
from functools import reduce
from pathlib import Path
from typing import Any

from ruamel.yaml.error import YAMLError

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params


def load(name: str, root: Path = PROJECT_ROOT) -> Params:
    """Return the parameters of `params.yaml` with a preset's values.

    Args:
        name: Name of the preset's file.
        root: The project's folder.

    Raises:
        InputError: There is no such preset, it overrides a missing key, or the result does not
            fit the models.
    """
    content = params_file.read(root / "params.yaml")
    for key, value in overrides(name, root).items():
        *parents, last = key.lstrip("+~").split(".")
        try:
            block = reduce(lambda outer, part: outer[part], parents, content)
            if not key.startswith("+"):
                del block[last]  # a key to override or remove must exist
            if not key.startswith("~"):
                block[last] = value
        except (KeyError, TypeError) as error:
            raise InputError(
                f"presets/{name}: given {key}, allowed: the keys of params.yaml"
            ) from error
    return params_file.check(content, f"presets/{name}")


def overrides(name: str, root: Path = PROJECT_ROOT) -> dict[str, Any]:
    """Return what a preset overrides: values by dotted key.

    Args:
        name: Name of the preset's file.
        root: The project's folder.

    Raises:
        InputError: There is no such preset, or it does not hold overrides.
    """
    path = root / "presets" / name
    try:
        words = shlex.split(path.read_text(encoding="utf-8"))
        pairs = [word.partition("=") for word in words if word != "-S"]
        return {key: params_file.parse(_spaced(value)) for key, _, value in pairs}
    except OSError as error:
        names = sorted(preset.name for preset in path.parent.iterdir())
        raise InputError(f"preset: given {name!r}, allowed: {', '.join(names)}") from error
    except (YAMLError, ValueError, RecursionError) as error:  # the second: quotes, encoding
        raise InputError(
            f"presets/{name}: not overrides: {' '.join(str(error).split())}"
        ) from error


def _spaced(value: str) -> str:
    """Return a value in Hydra's syntax as YAML, where `{a:1,b:2}` needs spaces."""
    return re.sub(r"(?<=[\w-]):(?=\S)", ": ", value)

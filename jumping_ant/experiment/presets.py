"""Presets: lists of overrides of `params.yaml`, in `presets/`.

`dvc exp run $(cat presets/NAME)` runs one of them in place; `load` gives the same parameters. As
Hydra has it, `+key=value` adds what is not there yet, and `~key` takes something away.
"""

import re
import shlex
from functools import reduce
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params


def load(name: str, root: Path = PROJECT_ROOT) -> Params:
    """Return the parameters of `params.yaml` with a preset's values.

    Args:
        name: Of the preset's file.
        root: The project's folder.

    Raises:
        InputError: There is no such preset, it overrides what is not there, or the result does not
            fit the models.
    """
    yaml = YAML(typ="safe")
    content = yaml.load((root / "params.yaml").read_text())
    for key, value in overrides(name, root).items():
        *parents, last = key.lstrip("+~").split(".")
        try:
            block = reduce(lambda outer, part: outer[part], parents, content)
            if not key.startswith("+"):
                del block[last]  # what is overridden or taken away is there
        except (KeyError, TypeError) as error:
            raise InputError(
                f"presets/{name}: given {key}, allowed: the keys of params.yaml"
            ) from error
        if not key.startswith("~"):
            block[last] = value
    return params_file.check(content, f"presets/{name}")


def overrides(name: str, root: Path = PROJECT_ROOT) -> dict[str, Any]:
    """Return what a preset overrides: values by dotted key.

    Args:
        name: Of the preset's file.
        root: The project's folder.

    Raises:
        InputError: There is no such preset.
    """
    path = root / "presets" / name
    try:
        words = shlex.split(path.read_text())
    except OSError as error:
        names = sorted(preset.name for preset in path.parent.iterdir())
        raise InputError(f"preset: given {name!r}, allowed: {', '.join(names)}") from error
    pairs = [word.partition("=") for word in words if word != "-S"]
    return {key: YAML(typ="safe").load(_spaced(value)) for key, _, value in pairs}


def _spaced(value: str) -> str:
    """Return a value in Hydra's words as YAML: `{a:1,b:2}` needs spaces there."""
    return re.sub(r"(?<=[\w-]):(?=\S)", ": ", value)

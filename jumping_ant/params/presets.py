"""Presets: lists of overrides of `params.yaml`, in `presets/`.

`dvc exp run $(cat presets/NAME)` runs one of them in place; `load` returns the parameters that DVC
makes of it.
"""

import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file
from jumping_ant.params.model import Params

MOST_CHARACTERS = 20_000  # of a preset, applied in seconds; the largest has some 8,000


def load(name: str, root: Path = PROJECT_ROOT) -> Params:
    """Return the parameters of `params.yaml` with a preset's values.

    Raises:
        InputError: There is no such preset, or it does not fit `params.yaml` or the models.
    """
    path = root / "presets" / name
    if not path.is_file():
        names = sorted(preset.name for preset in path.parent.iterdir())
        raise InputError(f"preset: given {name!r}, allowed: {', '.join(names)}")
    from dvc.exceptions import InvalidArgumentError  # type: ignore[import-untyped]
    from dvc.utils.hydra import apply_overrides  # type: ignore[import-untyped]  # slow to import

    if "${" in str(params_file.read(root / "params.yaml")):  # also checks what DVC reads
        raise InputError("params.yaml: given a reference ${...}, allowed: values alone")
    with TemporaryDirectory() as folder:
        params = Path(shutil.copy(root / "params.yaml", folder))
        try:
            words = _words(path)
            apply_overrides(params, [word for word in words if word != "-S"])
        except (InvalidArgumentError, ValueError, RecursionError) as error:  # also keys of lists
            reason = " ".join(str(error.__cause__ or error).split())
            line = f"presets/{name}: not overrides of params.yaml: {reason}"
            raise InputError(line) from error
        return params_file.check(params_file.read(params), f"presets/{name}")


def _words(path: Path) -> list[str]:
    """Return a preset's words as a shell splits them; functions and references are none."""
    text = path.read_text(encoding="utf-8")
    if len(text) > MOST_CHARACTERS:
        raise ValueError(f"given {len(text):,} characters, allowed: {MOST_CHARACTERS:,}")
    for word in text.split():
        if set(word) & set("($"):
            raise ValueError(f"given {word[:40]!r}, allowed: values alone")
    return text.split()

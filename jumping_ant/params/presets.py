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


def load(name: str, root: Path = PROJECT_ROOT) -> Params:
    """Return the parameters of `params.yaml` with a preset's values.

    Raises:
        InputError: There is no such preset, it does not hold overrides of what there is, the result
            does not fit the models, or DVC is not installed.
    """
    path = root / "presets" / name
    if not path.is_file():
        names = sorted(preset.name for preset in path.parent.iterdir())
        raise InputError(f"preset: given {name!r}, allowed: {', '.join(names)}")
    with TemporaryDirectory() as folder:
        params = Path(shutil.copy(root / "params.yaml", folder))
        words = path.read_text(encoding="utf-8").split()  # as a shell splits them
        _override(params, [word for word in words if word != "-S"], f"presets/{name}")
        return params_file.check(params_file.read(params), f"presets/{name}")


def _override(params: Path, overrides: list[str], where: str) -> None:
    """Change values of a params file, as `dvc exp run -S` does."""
    try:
        from dvc.exceptions import InvalidArgumentError  # type: ignore[import-untyped]
        from dvc.utils.hydra import apply_overrides  # type: ignore[import-untyped]
    except ImportError as error:
        raise InputError("presets: DVC reads them; install the package's extra `track`") from error
    try:
        apply_overrides(params, overrides)
    except (InvalidArgumentError, ValueError) as error:  # the second: encoding, keys of lists
        reason = " ".join(str(error.__cause__ or error).split())
        raise InputError(f"{where}: not overrides of params.yaml: {reason}") from error

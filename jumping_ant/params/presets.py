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
        InputError: There is no such preset, or it does not fit `params.yaml` or the models.
    """
    path = root / "presets" / name
    if not path.is_file():
        names = sorted(preset.name for preset in path.parent.iterdir())
        raise InputError(f"preset: given {name!r}, allowed: {', '.join(names)}")
    from dvc.exceptions import InvalidArgumentError  # type: ignore[import-untyped]
    from dvc.utils.hydra import apply_overrides  # type: ignore[import-untyped]  # slow to import

    with TemporaryDirectory() as folder:
        params = Path(shutil.copy(root / "params.yaml", folder))
        words = path.read_text(encoding="utf-8").split()  # as a shell splits them
        try:
            apply_overrides(params, [word for word in words if word != "-S"])
        except (InvalidArgumentError, ValueError) as error:  # the second: encoding, keys of lists
            reason = " ".join(str(error.__cause__ or error).split())
            line = f"presets/{name}: not overrides of params.yaml: {reason}"
            raise InputError(line) from error
        return params_file.check(params_file.read(params), f"presets/{name}")

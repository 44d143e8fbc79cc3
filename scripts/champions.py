"""Name the champion of each agent for DVC: the seed whose policy did best in validation.

Usage: python -m scripts.champions (`make champions`)
Reads: params.yaml, models/AGENT/seed-N/validation.csv.
Writes: champions/dvc.yaml, whose artifacts lead `dvc artifacts get` and GTO to the policies.

MLflow gives the same seeds the alias `champion`. Held-out episodes only judge.
"""

import io
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from jumping_ant.base import command_line
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file, validation
from jumping_ant.experiment.models import Params
from jumping_ant.play import content

FILE = Path("champions") / "dvc.yaml"
HEADER = "# The seeds that did best in validation. Made by `make champions`.\n"


def main() -> None:
    """Write the file."""
    command_line.parser(__doc__).parse_args()
    write_text(PROJECT_ROOT / FILE, text(PROJECT_ROOT, params_file.load()))
    print(f"{FILE}: written")


def text(root: Path, params: Params) -> str:
    """Return the content of `champions/dvc.yaml`.

    Raises:
        InputError: An agent is not trained, or its name is none for DVC's artifacts.
    """
    artifacts = {}
    for agent, block in params.agents.items():
        own = Paths(root).agent(agent)
        if not own.models.is_dir():
            raise InputError(f"{agent}: not trained yet; run `dvc repro`, or `dvc pull`")
        seed = content.champions(root, agent, params.seeds)[0]
        policy = own.seed(seed).policy.relative_to(root)
        artifacts[_checked(agent)] = _artifact(
            Path("..") / policy,
            block.algorithm,
            seed,
            validation.published_return(root, agent, seed),
        )
    stream = io.StringIO()
    YAML().dump({"artifacts": artifacts}, stream)
    return HEADER + stream.getvalue()


def _artifact(path: Path, algorithm: str, seed: int, mean_return: float) -> dict[str, Any]:
    return {
        "path": str(path),
        "type": "model",
        "desc": f"Policy of seed {seed}: observations in, torques out",
        "labels": [algorithm],
        "meta": {"seed": seed, "validation_return": round(mean_return, 1)},
    }


def _checked(agent: str) -> str:
    """Return an agent's name, if GTO takes it."""
    from gto.constants import assert_name_is_valid
    from gto.exceptions import ValidationError

    try:
        assert_name_is_valid(agent)
    except ValidationError as error:
        raise InputError(
            f"agents: given {agent!r}, allowed as the name of an artifact: two characters or more, "
            "the last a letter or a digit"
        ) from error
    return agent


if __name__ == "__main__":
    with reported():
        main()

"""Digest the code that each stage runs, so that a change reruns only the stages that it affects.

Usage: python -m stages.digest
Reads: jumping_ant/, stages/, requirements.lock.
Writes: .inputs/code/STAGE.json, for training .inputs/train/ALGORITHM/code.json: the SHA-256 of what
    every file does that the stage imports, directly or not (its text without comments, docstrings
    and blank lines), of the pages beside them, and of the locked versions. An algorithm that needs
    demonstrations gets its file from `demonstrate`, which finds it as
    .inputs/code/train-ALGORITHM.json.
"""

import hashlib
from pathlib import Path

from jumping_ant.agents.catalogue import ALGORITHMS, demonstrated
from jumping_ant.agents.training_code import training_code
from jumping_ant.base import command_line, effective_code, imports
from jumping_ant.base.files import PROJECT_ROOT, to_json, write_all
from jumping_ant.base.paths import Paths

from . import run

TRAIN = "train-"
# Modules that a stage does not import: MLflow's models hold this one.
MORE = {"track": "jumping_ant/tracking/serving.py"}
PAGES = (".css", ".html", ".js")  # what code reads beside it; an editor's leftovers are none


def code() -> dict[str, set[Path]]:
    """Return the files that each stage runs, by the name of its digests."""
    scripts = {path.stem: path for path in (PROJECT_ROOT / "stages").glob("[a-z]*.py")}
    del scripts[Path(__file__).stem]
    train = scripts.pop("train")
    found = {stage: imports.closure(script) for stage, script in scripts.items()}
    for stage, module in MORE.items():
        found[stage] |= imports.closure(PROJECT_ROOT / module)
    found |= {f"{TRAIN}{algorithm}": training_code(algorithm, train) for algorithm in ALGORITHMS}
    return {name: files | _beside(files) for name, files in found.items()}


def _beside(files: set[Path]) -> set[Path]:
    """Return the pages, which code reads, in the folders of the given files."""
    listed = {path for folder in {file.parent for file in files} for path in folder.iterdir()}
    return {path for path in listed if path.suffix in PAGES and not path.name.startswith(".")}


def _place(name: str) -> Path:
    """Return the file of digests of a stage's code."""
    algorithm = name.removeprefix(TRAIN)
    if algorithm == name or algorithm in demonstrated():
        return Paths().code(name)
    return Paths().training_code(algorithm)


def main() -> None:
    """Run the stage."""
    command_line.parser(__doc__).parse_args()
    found = {name: {*files, PROJECT_ROOT / "requirements.lock"} for name, files in code().items()}
    digests = {
        file: hashlib.sha256(effective_code.read(file).encode()).hexdigest()
        for file in set.union(*found.values())
    }
    write_all(
        {
            _place(name): to_json(
                {str(file.relative_to(PROJECT_ROOT)): digests[file] for file in sorted(files)}
            )
            for name, files in found.items()
        }
    )


if __name__ == "__main__":
    run(main)

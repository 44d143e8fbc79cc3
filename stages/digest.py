"""Digest the code that each stage runs, so that a change reruns only the stages that it affects.

Usage: python -m stages.digest
Reads: jumping_ant/, stages/, requirements.lock.
Writes: .inputs/code/STAGE.json, for training .inputs/train/ALGORITHM/code.json: the SHA-256 of each
    file that the stage imports, directly or not, without comments, docstrings and blank lines, and
    of the pages beside them; the locked versions of libraries. An algorithm that needs
    demonstrations gets its file from `demonstrate`, which reads .inputs/code/train-ALGORITHM.json.
    .inputs/code/files.json has the SHA-256 of each file as it is: what equals it is not parsed.
"""

import functools
from pathlib import Path

from jumping_ant.agents.catalogue import ALGORITHMS, demonstrated
from jumping_ant.agents.training_code import training_code
from jumping_ant.base import command_line, effective_code, imports
from jumping_ant.base.files import PROJECT_ROOT, digest, to_json, write_all
from jumping_ant.base.paths import Paths
from jumping_ant.params import inputs

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
    listed = {path for folder in {file.parent for file in files} for path in folder.iterdir()}
    return {path for path in listed if path.suffix in PAGES and not path.name.startswith(".")}


_digest = functools.cache(effective_code.digest)  # many stages run the same files


def key(name: str, files: set[Path], lock: Path = imports.LOCK) -> dict[str, str]:
    """Return what a stage's code depends on: digests of files, and versions of libraries."""
    row = ALGORITHMS.get(name.removeprefix(TRAIN))
    learner = [row.learner.partition(":")[0]] if row else []
    digests = {_name(file): _digest(file) for file in sorted(files)}
    versions = imports.versions(files, *learner, lock=lock)
    if row:
        versions.pop("pandas", None)  # reads tables, which training only writes
    return digests | versions


def _name(file: Path) -> str:
    return str(file.relative_to(PROJECT_ROOT))


def _place(name: str) -> Path:
    """Return the file of digests of a stage's code."""
    algorithm = name.removeprefix(TRAIN)
    if algorithm == name or algorithm in demonstrated():
        return Paths().code(name)
    return Paths().training_code(algorithm)


def main() -> None:
    """Run the stage."""
    command_line.parser(__doc__).parse_args()
    stages = code()
    content = {_place(name): key(name, files) for name, files in stages.items()}
    for digests in content.values():
        inputs.require_versions(digests)
    seen = {_name(file): digest(file) for file in sorted(set().union(*stages.values()))}
    write_all({path: to_json(it) for path, it in {**content, Paths().code("files"): seen}.items()})


if __name__ == "__main__":
    run(main)

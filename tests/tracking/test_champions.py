"""The champions that DVC and GTO know: those of MLflow, for whoever has only the repository."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from ruamel.yaml import YAML
from tracked_project import AGENTS, query

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import digest, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file
from scripts import champions

TOOLS = Path(sys.executable).parent


def run(folder: Path, line: str) -> None:
    identity = {
        f"GIT_{who}_{what}": "me@here"
        for who in ("AUTHOR", "COMMITTER")
        for what in ("NAME", "EMAIL")
    }
    path = f"{TOOLS}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-ec", line],
        cwd=folder,
        env=os.environ | identity | {"PATH": path, "DVC_NO_ANALYTICS": "1"},
        capture_output=True,
        encoding="utf-8",
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_they_are_those_of_mlflow(project: Path) -> None:
    content = champions.text(project, params_file.load(project / "params.yaml"))
    named = YAML(typ="safe").load(content)["artifacts"]
    sql = (
        "SELECT t.value FROM registered_model_aliases a JOIN model_version_tags t "
        "ON t.name = a.name AND t.version = a.version AND t.key = 'seed' WHERE a.name = ?"
    )
    of_mlflow = {agent: int(query(project, sql, f"jumping-ant-{agent}")[0][0]) for agent in AGENTS}
    assert {agent: own["meta"]["seed"] for agent, own in named.items()} == of_mlflow
    for agent, seed in of_mlflow.items():
        path = project / "champions" / named[agent]["path"]
        assert path.resolve() == Paths(project).agent(agent).seed(seed).policy


def test_a_released_champion_is_fetched_from_the_repository(project: Path, tmp_path: Path) -> None:
    """As docs/shared.md says, from another folder than the project's."""
    params = params_file.load(project / "params.yaml")
    write_text(project / champions.FILE, champions.text(project, params))
    run(
        project,
        "git init -q && dvc init -q && dvc config core.analytics false && dvc add -q models/sac && "
        "git add -A champions models && git commit -qm Run && "
        "gto register champions:sac && gto assign champions:sac --version v0.0.1 --stage release",
    )
    run(tmp_path, f"dvc artifacts get '{project}' champions:sac --stage release -o policy.zip")
    seed = YAML(typ="safe").load(project / champions.FILE)["artifacts"]["sac"]["meta"]["seed"]
    assert digest(tmp_path / "policy.zip") == digest(Paths(project).agent("sac").seed(seed).policy)


def test_what_is_not_trained_or_has_no_proper_name_is_told(project: Path) -> None:
    params = params_file.load(project / "params.yaml")
    agents = {"sac-": params.agent("sac"), **params.agents}
    with pytest.raises(InputError, match="sac-: not trained yet"):
        champions.text(project, params.model_copy(update={"agents": agents}))
    with pytest.raises(InputError, match="given 'sac-', allowed as the name of an artifact"):
        champions._checked("sac-")

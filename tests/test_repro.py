"""`make repro` lists what DVC will run, and what it took the last time."""

import re
import subprocess

import pytest
from ruamel.yaml import YAML

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import params_file
from scripts.checkout import Checkout, copy_project

BOMB = "a0: &a0 [0]\n" + "".join(f"a{n}: &a{n} [{f'*a{n - 1}, ' * 30}]\n" for n in range(1, 7))
UP_TO_DATE = "Data and pipelines are up to date."
COMMAND = ("python", "-m", "scripts.repro")
SHORT = {  # the first stage writes what it reads, without every 2
    "build": {"cmd": "tr -d 2 < input > first", "deps": ["input"], "outs": ["first"]},
    "late": {"cmd": "cp first second", "deps": ["first"], "outs": ["second"]},
    "last": {"cmd": "cp second third", "deps": ["second"], "outs": ["third"]},
}


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Checkout:
    """A copy of the project in which nothing has run."""
    project = Checkout(tmp_path_factory.mktemp("checkout") / "project")
    copy_project(project.folder)
    (project.folder / "dvc.lock").unlink()
    return project


def repro(project: Checkout, *targets: str) -> tuple[dict[str, str], list[str], str]:
    """Run the command; return the listed seconds, the stages that ran, and the last line."""
    done = project.run(*COMMAND, *targets)
    assert done.returncode == 0, done.stderr
    listed = dict(re.findall(r"^  (\S+) +(\d+|-)$", done.stdout, re.MULTILINE))
    ran = re.findall(r"^Running stage '(.+)':$", done.stdout, re.MULTILINE)
    return listed, ran, done.stdout.splitlines()[-1]


@pytest.mark.parametrize("command", [COMMAND, ("python", "-m", "scripts.preset", "smoke")])
def test_a_mistyped_stage_is_named(project: Checkout, command: tuple[str, ...]) -> None:
    done = project.run(*command, "typo")
    assert done.returncode
    assert "ERROR: Stage 'typo' not found inside 'dvc.yaml' file" in done.stderr
    assert "Running stage" not in done.stdout


@pytest.mark.parametrize("variable", ["STAGES=typo", "AGENT=sac"])
def test_make_repro_refuses_what_it_does_not_take(variable: str) -> None:
    command = ["make", "--no-print-directory", "-n", "repro", variable]
    done = subprocess.run(command, cwd=PROJECT_ROOT, encoding="utf-8", capture_output=True)
    assert done.returncode == 2 and "scripts.repro" not in done.stdout
    name = variable.partition("=")[0]
    assert f"make repro takes no {name}: `dvc repro STAGE` runs a stage" in done.stderr


def test_a_bomb_is_refused_before_dvc_reads_it(project: Checkout) -> None:
    path = project.folder / "params.yaml"
    before = path.read_text(encoding="utf-8")
    path.write_text(f"{before}\n{BOMB}", encoding="utf-8")
    done = project.run(*COMMAND)
    path.write_text(before, encoding="utf-8")
    assert done.returncode == 2 and done.stderr.startswith("error: ")
    assert "Running stage" not in done.stdout


def test_stages_are_listed_with_their_last_seconds(project: Checkout) -> None:
    cheap = ["digest", "check", "build"]
    listed, ran, _ = repro(project, "build")
    assert (listed, ran) == (dict.fromkeys([*cheap, "sum"], "-"), cheap)
    assert repro(project, "build") == ({}, [], UP_TO_DATE)
    with (project.folder / "params.yaml").open("a", encoding="utf-8") as file:
        file.write("# A comment.\n")
    assert repro(project, "build")[1] == ["check"]
    params = params_file.load().model_dump()
    params["robot"]["density"] *= 2
    project.write_params(params)
    listed, ran, _ = repro(project, "build")
    assert ran == ["check", "build"]
    assert listed.keys() == {*ran, "sum"} and "-" not in listed.values()
    check, build, together = map(int, listed.values())
    assert abs(together - check - build) <= 1  # each is rounded


def test_what_depends_on_a_stage_is_listed_once_the_first_ones_have_run(project: Checkout) -> None:
    """DVC's `--dry` alone leaves out stages whose inputs are yet to change."""
    with (project.folder / "dvc.yaml").open("w", encoding="utf-8") as file:
        YAML().dump({"stages": SHORT}, file)
    for text, stages in [("1", [*SHORT]), ("12", ["build"]), ("3", [*SHORT])]:
        (project.folder / "input").write_text(text, encoding="utf-8")
        listed, ran, end = repro(project)
        assert ran == stages
        assert listed.keys() == {*stages, "sum"}
        assert (end == UP_TO_DATE) == (stages == ["build"])

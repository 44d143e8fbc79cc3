"""`make install` in other people's folders; a stand-in for uv makes empty environments."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from scripts import checkout

UV = f"""#!/bin/sh
case $1 in
cache) echo /tmp ;;
venv) {sys.executable} -m venv --without-pip .venv ;;
*) if [ ! -t 0 ]; then cat >/dev/null; fi ;;
esac
"""
ABOUT = """
import os, shutil
print(os.environ["DVC_SITE_CACHE_DIR"], oct(os.stat(os.environ["DVC_SITE_CACHE_DIR"]).st_mode)[-3:])
print(shutil.which("python"))
"""


def copy_files(folder: Path, *names: str) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(PROJECT_ROOT / name, folder / name)


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """What is needed to install, in a home of José's."""
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "uv").write_text(UV, encoding="utf-8")
    (tmp_path / "tools" / "uv").chmod(0o755)
    folder = tmp_path / "José's home" / "robot #1"
    copy_files(folder, "Makefile", "scripts/environment.sh", "requirements.lock", "pyproject.toml")
    return folder


def make(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["make", "--no-print-directory", *(arguments or [".venv/.packages"])],
        cwd=folder,
        env={"PATH": f"{folder.parents[1]}/tools:/usr/bin:/bin", "HOME": "/tmp"} | variables,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        encoding="utf-8",
    )


def is_installed(folder: Path) -> bool:
    """Make the environment; tell whether its Python finds its files, and no more is to do."""
    if make(folder).returncode:
        return False
    printed = subprocess.run(
        [folder / ".venv" / "bin" / "python", "-c", ABOUT],
        env={"PATH": "/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        encoding="utf-8",
    ).stdout
    expected = f"{folder}/.venv/.dvc 700\n{folder}/.venv/bin/python\n"
    return printed == expected and "up to date" in make(folder).stdout


def test_an_environment_is_made_anew_where_it_would_not_work(project: Path) -> None:
    assert is_installed(project)
    moved = project.rename(project.with_name("moved"))
    assert is_installed(moved)
    (moved / ".venv" / "bin" / "python").unlink()
    (moved / ".venv" / "bin" / "python").symlink_to("/of/a/version/that/was/removed")
    assert is_installed(moved)


def test_an_environment_of_another_project_is_used_and_not_changed(project: Path) -> None:
    """Copies of presets have links to it."""
    make(project)
    copy = project.with_name("copy")
    shutil.copytree(project, copy, symlinks=True, ignore=shutil.ignore_patterns(".venv"))
    (copy / ".venv").symlink_to(project / ".venv")
    assert "up to date" in make(copy).stdout
    (copy / "requirements.lock").touch()
    assert f".venv belongs to {project}/.venv. Run `make install` in that" in make(copy).stderr
    shutil.rmtree(project)
    assert "or `rm .venv` to have an environment here" in make(copy).stderr


def test_a_clone_has_the_same_bytes_whatever_git_is_set_to_and_no_environment(
    tmp_path: Path,
) -> None:
    names = ("dvc.lock", "scripts/environment.sh", "results/agents/sac/episodes.csv")
    copy_files(tmp_path / "a", ".gitattributes", ".gitignore", *names)
    (tmp_path / "a" / ".venv").symlink_to(sys.prefix)
    for command in ("init -q", "add -A", "commit -qm a"):
        subprocess.run(["git", *command.split()], cwd=tmp_path / "a", check=True)
    clone = ["git", "clone", "-q", "-c", "core.autocrlf=true", "a", "b"]
    subprocess.run(clone, cwd=tmp_path, check=True)
    for name in names:
        assert (tmp_path / "b" / name).read_bytes() == (PROJECT_ROOT / name).read_bytes()
    assert not (tmp_path / "b" / ".venv").is_symlink()


def test_recipes_do_not_get_what_other_tools_read(project: Path) -> None:
    """Variables of the command line, and what ROS sets: a folder of packages of its own."""
    (project / "numpy.py").write_text("raise RuntimeError('of another Python')", encoding="utf-8")
    ros = {"PYTHONPATH": str(project), "PYTHONHOME": str(project)}
    printed = make(project, "AGENT=sac", "--eval", "all: ; @env", "all", **ros).stdout
    names = {line.partition("=")[0] for line in printed.splitlines()}
    assert "TORCH_INDEX" in names and not names & {"AGENT", *ros}


def test_dvc_finds_the_python_of_its_environment(tmp_path: Path) -> None:
    """`.venv/bin/dvc repro`, where nothing was activated."""
    checkout.copy_project(tmp_path)
    environment = {"HOME": os.environ["HOME"], "PATH": "/usr/bin:/bin", "USER": "test"}

    def dvc(*command: str) -> str:
        called = [f"{sys.prefix}/bin/dvc", *command]
        return subprocess.check_output(called, cwd=tmp_path, env=environment, encoding="utf-8")

    dvc("repro", "digest")
    assert f"Repo.site_cache_dir: {Path(sys.prefix).resolve()}/.dvc/" in dvc("doctor")


@pytest.mark.parametrize(
    ("owner", "message"),
    [
        ("0", "fatal: not a git repository .*; without a repository, run `git init` there"),
        ("1", "fatal: detected dubious ownership .* git config --global --add safe.directory "),
    ],
)
def test_what_git_refuses_is_explained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, owner: str, message: str
) -> None:
    monkeypatch.setattr(checkout, "PROJECT_ROOT", tmp_path)
    if owner == "1":
        subprocess.run(["git", "init", "-q", tmp_path], check=True)
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", owner)
    with pytest.raises(InputError, match=message):
        checkout.project_files()


def test_a_run_begins_by_saying_that_git_has_no_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(checkout, "PROJECT_ROOT", tmp_path)
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    checkout.warn_of_no_name()
    assert "without which `dvc exp run` stops: git config --global" in capsys.readouterr().out
    for key in ("name", "email"):
        subprocess.run(["git", "config", f"user.{key}", "a"], cwd=tmp_path, check=True)
    checkout.warn_of_no_name()
    assert capsys.readouterr().out == ""

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

FILES = ("Makefile", "scripts/environment.sh", "requirements.lock", "pyproject.toml")
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


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """What is needed to install, in a home of José's."""
    (tmp_path / "tools").mkdir()
    (tmp_path / "tools" / "uv").write_text(UV, encoding="utf-8")
    (tmp_path / "tools" / "uv").chmod(0o755)
    folder = tmp_path / "José's home" / "robot #1"
    for name in FILES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(PROJECT_ROOT / name, folder / name)
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


def is_whole(folder: Path) -> bool:
    """Tell whether an environment's Python finds what is its own, and `make` has no more to do."""
    told = subprocess.run(
        [folder / ".venv" / "bin" / "python", "-c", ABOUT],
        env={"PATH": "/usr/bin:/bin"},
        stdout=subprocess.PIPE,
        encoding="utf-8",
    ).stdout
    own = f"{folder}/.venv/.dvc 700\n{folder}/.venv/bin/python\n"
    return told == own and "up to date" in make(folder).stdout


def test_an_environment_is_made_anew_where_it_would_not_work(project: Path) -> None:
    done = make(project)
    assert done.returncode == 0 and is_whole(project), done.stderr
    assert "2.8 GB, or 6.7 GB with CUDA" in done.stdout
    moved = project.rename(project.with_name("moved"))
    assert make(moved).returncode == 0 and is_whole(moved)
    (moved / ".venv" / "bin" / "python").unlink()
    (moved / ".venv" / "bin" / "python").symlink_to("/of/a/version/that/was/removed")
    assert make(moved).returncode == 0 and is_whole(moved)


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


def test_the_environment_is_never_committed(tmp_path: Path) -> None:
    shutil.copy(PROJECT_ROOT / ".gitignore", tmp_path)
    (tmp_path / ".venv").symlink_to(sys.prefix)
    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    subprocess.run(["git", "check-ignore", "-q", ".venv"], cwd=tmp_path, check=True)


def test_a_clone_has_the_same_bytes_whatever_line_ends_git_is_set_to(tmp_path: Path) -> None:
    names = ("dvc.lock", "scripts/environment.sh", "results/agents/sac/episodes.csv")
    for name in (".gitattributes", *names):
        (tmp_path / "a" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(PROJECT_ROOT / name, tmp_path / "a" / name)
    for command in ("init -q", "add -A", "commit -qm a"):
        subprocess.run(["git", *command.split()], cwd=tmp_path / "a", check=True)
    clone = ["git", "clone", "-q", "-c", "core.autocrlf=true", "a", "b"]
    subprocess.run(clone, cwd=tmp_path, check=True)
    for name in names:
        assert (tmp_path / "b" / name).read_bytes() == (PROJECT_ROOT / name).read_bytes()


def test_recipes_do_not_get_what_other_tools_read(project: Path) -> None:
    """Variables of the command line, and what ROS sets: a folder of packages of its own."""
    (project / "numpy.py").write_text("raise RuntimeError('of another Python')", encoding="utf-8")
    ros = {"PYTHONPATH": str(project), "PYTHONHOME": str(project)}
    told = make(project, "AGENT=sac", "--eval", "told: ; @env", "told", **ros).stdout
    names = {line.partition("=")[0] for line in told.splitlines()}
    assert "TORCH_INDEX" in names and not names & {"AGENT", *ros}


def test_dvc_finds_the_python_of_its_environment(tmp_path: Path) -> None:
    """`.venv/bin/dvc repro`, where nothing was activated."""
    checkout.copy_project(tmp_path)
    own = {"HOME": os.environ["HOME"], "PATH": "/usr/bin:/bin", "USER": "test"}
    dvc = [f"{sys.prefix}/bin/dvc", "repro", "digest"]
    done = subprocess.run(dvc, cwd=tmp_path, env=own, capture_output=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    doctor = subprocess.run([dvc[0], "doctor"], cwd=tmp_path, env=own, capture_output=True)
    assert f"Repo.site_cache_dir: {Path(sys.prefix).resolve()}/.dvc/" in doctor.stdout.decode()


@pytest.mark.parametrize(
    ("owner", "told"),
    [
        ("0", "fatal: not a git repository .*; without a repository, run `git init` there"),
        ("1", "fatal: detected dubious ownership .* git config --global --add safe.directory "),
    ],
)
def test_what_git_refuses_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, owner: str, told: str
) -> None:
    monkeypatch.setattr(checkout, "PROJECT_ROOT", tmp_path)
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", owner)
    if owner == "1":
        subprocess.run(["git", "init", "-q", tmp_path], check=True)
    with pytest.raises(InputError, match=told):
        checkout.project_files()


def test_who_has_no_name_is_told_before_a_run(
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

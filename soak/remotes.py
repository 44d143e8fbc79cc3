"""A project that machines share: git over SSH, DVC over SSH and S3, and experiments.

Usage: python -m soak.remotes (takes root, and ten minutes)

The store, the desk and two other machines are hosts of their own (see `soak.hosts`) that share no
disk. The desk runs a comparison, and pushes it to the store: by git over SSH, by DVC over SSH and
over S3, which must refuse a wrong key. Each of the other machines clones it and pulls from one of
the remotes: all must be there, nothing may be stale, and MLflow must be whole. On the first a grid
of experiments runs, three at a time, and one in a folder of its own; the desk pulls one.
"""

import json
import shlex
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from jumping_ant.base import command_line
from jumping_ant.base.files import digest
from jumping_ant.experiment import params_file, presets
from scripts.checkout import Checkout, checkout
from soak import hosts, s3_server, ssh_server
from soak.hosts import Host

STORE, DESK, OTHER, THIRD = "store", "desk", "other", "third"
GIT, FILES = "/tmp/git/project.git", "/tmp/dvc"
RATES = (0.001, 0.002, 0.003)
STAGE = "evaluate@sac"
JOBS = 3
MEDIA = ("media/sac.mp4", "media/lineup.rrd", "results/report.html", "models/sac/seed-0/policy.zip")
SECONDS = 1200.0

Figures = dict[str, Any]


def main() -> None:
    """Run, print the figures, and exit with 1 if anything went wrong."""
    parser = command_line.parser(__doc__, "python -m soak.remotes")
    parser.parse_args()
    lacking = [server.MISSING for server in (ssh_server, s3_server) if server.PROGRAM is None]
    if reason := hosts.missing() or "; ".join(lacking):
        parser.error(reason)
    with checkout() as project:
        figures = share(prepared(project))
    print(json.dumps(figures, indent=2))


def prepared(project: Checkout) -> Checkout:
    """Run a whole comparison in a project, and commit it."""
    content = presets.load("smoke").model_dump()
    content["compute"] |= {"live_after_seconds": 0}
    (project.folder / "dvc.lock").unlink()  # DVC reads and writes all of it after each stage
    project.write_params(params_file.check(content))
    project.seconds("dvc", "repro")
    commit = "-c user.name=Test -c user.email=test@example.org commit -qm Run"
    project.seconds("git", "add", "-A")
    project.seconds("git", *commit.split())
    project.seconds("git", "branch", "-M", "main")
    return project


@dataclass
class Machine:
    """A host with a clone of the project.

    Attributes:
        host: The host.
        folder: The clone's folder there.
        variables: Of its commands.
    """

    host: Host
    folder: Path
    variables: Mapping[str, str]

    def run(self, line: str, folder: Path | None = None) -> str:
        """Run a line as a person types it, and return what it prints.

        Raises:
            RuntimeError: It failed.
        """
        begun = self.host.log.stat().st_size if self.host.log.exists() else 0
        command = self.host.start(
            "bash", "-c", line, folder=folder or self.folder, **self.variables
        )
        status = command.wait(SECONDS)
        told = self.host.log.read_bytes()[begun:].decode()
        if status:
            raise RuntimeError(f"{self.host.name}: {line}\n{told}")
        return told


@dataclass(frozen=True)
class Remote:
    """A remote of DVC.

    Attributes:
        name: Its name.
        url: Its address.
        own: What each user keeps apart: the keys to it.
        options: What the project says of it, beside its address.
    """

    name: str
    url: str
    own: Mapping[str, str] = field(repr=False)
    options: Mapping[str, str] = field(default_factory=dict)

    def add(self, machine: Machine) -> None:
        """Add it to a project."""
        machine.run(f"dvc remote add {self.name} {self.url}")
        for option, value in self.options.items():
            machine.run(f"dvc remote modify {self.name} {option} {value}")

    def unlock(self, machine: Machine) -> None:
        """Give a user the keys."""
        for option, value in self.own.items():
            machine.run(f"dvc remote modify --local {self.name} {option} {value}")


def share(project: Checkout) -> Figures:
    """Push a project, pull it elsewhere, run experiments there and take one back."""
    environment = Path(sys.prefix)
    with tempfile.TemporaryDirectory() as name:
        keys = ssh_server.Keys(Path(name))
        keys.make()
        account = s3_server.Account()
        shown = {
            STORE: [keys.folder, Path(str(s3_server.PROGRAM)).parent],
            DESK: [environment, keys.folder, project.folder],
            OTHER: [environment, keys.folder],
            THIRD: [environment, keys.folder],
        }
        with hosts.running((STORE, DESK, OTHER, THIRD), shown) as found:
            store = found[STORE]
            ssh_server.start(store, keys)
            s3_server.start(store, account, keys.folder)
            store.start("git", "init", "-q", "--bare", "-b", "main", GIT).wait()
            address = f"ssh://root@{store.address}:{ssh_server.PORT}"
            for client in (DESK, OTHER, THIRD):
                keys.use(found[client])
            variables = _variables()
            desk = Machine(found[DESK], project.folder, variables)
            other, third = (
                Machine(found[client], Path("/tmp/project"), variables) for client in (OTHER, THIRD)
            )
            ssh = Remote("ssh", address + FILES, {"keyfile": str(keys.user)})
            s3 = Remote("s3", s3_server.URL, account.options(), s3_server.options(store))
            figures: Figures = {}
            _begun(desk, address + GIT, (ssh, s3))
            _refused(desk, s3)
            for remote, machine in ((ssh, other), (s3, third)):
                figures[remote.name] = _pushed(desk, remote)
                figures[remote.name] |= _pulled(machine, address + GIT, remote, project)
            figures |= _experimented(other, desk)
    return figures


def _variables() -> dict[str, str]:
    tools = Path(sys.executable).parent
    own = {"PATH": f"{tools}:/usr/local/bin:/usr/bin:/bin"}
    names = ("AUTHOR", "COMMITTER")
    own |= {f"GIT_{name}_NAME": "Test" for name in names}
    own |= {f"GIT_{name}_EMAIL": "test@example.org" for name in names}
    switches = ("DVC_NO_ANALYTICS", "MLFLOW_DISABLE_TELEMETRY")
    return own | dict.fromkeys(switches, "true") | {"RAY_USAGE_STATS_ENABLED": "0"}


def _begun(desk: Machine, origin: str, remotes: Sequence[Remote]) -> None:
    """Push the project to its origin, with remotes; the first is what DVC uses unless told."""
    desk.run(f"git remote add origin {origin}")
    for remote in remotes:
        remote.add(desk)
        remote.unlock(desk)
    desk.run(f"dvc remote default {remotes[0].name}")
    desk.run("git commit -qam Remotes && git push -q origin main")


def _refused(desk: Machine, s3: Remote) -> None:
    """Try to push with a wrong key."""
    replace(s3, own={**s3.own, "secret_access_key": "wrong"}).unlock(desk)
    told = desk.run(f"! dvc push -r {s3.name}")
    if "Forbidden" not in told:
        raise RuntimeError(f"a wrong key: {told}")
    s3.unlock(desk)


def _pushed(desk: Machine, remote: Remote) -> Figures:
    before, began = desk.host.bytes_moved()[1], time.monotonic()
    desk.run(f"dvc push -r {remote.name}")
    seconds = time.monotonic() - began
    sent = desk.host.bytes_moved()[1] - before
    told = desk.run(f"dvc push -r {remote.name}")
    if "Everything is up to date." not in told:
        raise RuntimeError(f"pushed again: {told}")
    return {"pushed_bytes": sent, "push_seconds": round(seconds, 1)}


def _pulled(other: Machine, origin: str, remote: Remote, project: Checkout) -> Figures:
    other.run(f"git clone -q {origin} {other.folder}", Path("/tmp"))
    remote.unlock(other)
    began = time.monotonic()
    other.run(f"dvc pull -r {remote.name}")
    seconds = time.monotonic() - began
    sums = other.run(f"sha256sum {' '.join(MEDIA)}").splitlines()
    own = [digest(project.folder / name) for name in MEDIA]
    if [line.split()[0] for line in sums] != own:
        raise RuntimeError(f"other bytes: {sums}")
    stale = other.run("dvc status --json").strip()
    if stale != "{}":
        raise RuntimeError(f"stale after a pull: {stale}")
    told = other.run("dvc repro")
    if "Data and pipelines are up to date." not in told:
        raise RuntimeError(f"run again after a pull: {told}")
    tracked = other.run("python -m stages.track").splitlines()[-1]
    if not tracked.endswith(" created"):
        raise RuntimeError(f"tracked: {tracked}")
    other.run("CI=1 rerun rrd verify media/lineup.rrd")
    other.run(f"python -c {shlex.quote(_PAGE)}")
    return {"pull_seconds": round(seconds, 1), "stale": 0, "tracked": tracked.rpartition(": ")[2]}


def _experimented(other: Machine, desk: Machine) -> Figures:
    """Run a grid in a queue, and one experiment in a folder of its own; exchange one."""
    rates = ",".join(map(str, RATES))
    other.run(f"dvc exp run --queue -S agents.sac.learning_rate={rates} {STAGE}")
    began = time.monotonic()
    other.run(f"dvc queue start --jobs {JOBS}")
    other.run(
        "while dvc queue status | grep -qE 'Queued|Running'; do sleep 5; done; dvc queue status"
    )
    seconds = time.monotonic() - began
    other.run(f"dvc exp run --temp --name apart -S agents.sac.learning_rate=0.004 {STAGE}")
    shown = json.loads(other.run("dvc exp show --json"))
    ended = [
        branch["revs"][0]["name"] for entry in shown for branch in entry.get("experiments") or ()
    ]
    if len(ended) != len(RATES) + 1:
        raise RuntimeError(f"experiments: {ended}\n{other.run('dvc queue status')}")
    checkpoints = other.run("ls -d .checkpoints/sac/*").split()
    live = other.run("python -c " + shlex.quote(_LIVE)).split()
    other.run("dvc exp push origin apart")
    desk.run("dvc exp pull origin apart && dvc exp apply apart")
    moved = [machine.run("dvc exp show --json --no-pager") for machine in (other, desk)]
    metrics = [_metrics(told) for told in moved]
    if metrics[0] != metrics[1]:
        raise RuntimeError(f"the experiment differs: {metrics}")
    return {
        "experiments": len(ended),
        "queue_seconds": round(seconds, 1),
        "checkpoint_folders": len(checkpoints),
        "live_runs": int(live[-1]),
    }


_PAGE = """
import subprocess, sys, urllib.request
command = [sys.executable, "-m", "jumping_ant.tracking.ui", "--port", "0"]
ui = subprocess.Popen(command, stdout=subprocess.PIPE, encoding="utf-8")
for line in ui.stdout:
    if line.startswith("Look at "):
        address = line.split()[2]
    if line.startswith("Ctrl-C"):
        break
place, _, token = address.partition("#")[0].partition("?token=")
request = urllib.request.Request(place, headers={"Authorization": f"Bearer {token}"})
with urllib.request.urlopen(request, timeout=120) as page:
    assert page.status == 200 and b"MLflow" in page.read()
ui.terminate()
"""
_LIVE = """
import mlflow
client = mlflow.MlflowClient("sqlite:///mlflow.db")
experiment = client.get_experiment_by_name("jumping-ant")
print(len(client.search_runs([experiment.experiment_id], "tags.live = 'true'")))
"""


def _metrics(told: str) -> Any:
    """Return the metrics of the experiment `apart`."""
    for entry in json.loads(told):
        for branch in entry.get("experiments") or ():
            if branch["revs"][0]["name"] == "apart":
                return branch["revs"][0]["data"]["metrics"]
    raise RuntimeError("no experiment apart")


if __name__ == "__main__":
    main()

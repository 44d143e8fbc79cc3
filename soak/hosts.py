"""Hosts of one's own: Linux namespaces with a network address, processes and folders apart.

Each host has its own address on a network that only these hosts are on, its own process numbers,
/tmp, /dev/shm and host name. It shares the system's read-only files and the folders that it is
given, and nothing else. When its first process is killed, the kernel ends all others and removes
its link, as a power cut does. Nothing of the machine's own network is changed. It takes root.
"""

import os
import shlex
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

NETWORK = "10.77.0"
BRIDGE, LINK = "bridge", "eth0"
NEEDED = ("ip", "unshare", "nsenter", "setpriv", "mount")
SECONDS_TO_START = 30.0


@dataclass
class Host:
    """A host.

    Attributes:
        name: Its host name.
        address: Its IP address.
        process: Outside of it, the process whose end is its end.
        first: Number of its first process, as seen from outside.
        logs: Folder outside of it, for what its commands print.
    """

    name: str
    address: str
    process: "subprocess.Popen[bytes]"
    first: int
    logs: Path
    _commands: list["subprocess.Popen[bytes]"] = field(default_factory=list)

    def start(
        self, *command: str, folder: Path = Path("/"), **variables: str
    ) -> "subprocess.Popen[bytes]":
        """Start a command in a folder of this host; its output goes to `log`."""
        with self.log.open("ab") as file:
            started = subprocess.Popen(
                [*_enter(self.first), f"--wdns={folder}", *command],
                env=_environment() | variables,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self._commands.append(started)
        return started

    @property
    def log(self) -> Path:
        """The file of what its commands print."""
        return self.logs / f"{self.name}.log"

    def bytes_moved(self) -> tuple[int, int]:
        """Return how many bytes this host has received and sent, by its link's own count."""
        counts = Path("/proc") / str(self.first) / "net" / "dev"
        for line in counts.read_text(encoding="ascii").splitlines():
            name, _, numbers = line.partition(":")
            if name.strip() == LINK:
                return int(numbers.split()[0]), int(numbers.split()[8])
        raise RuntimeError(f"{self.name} has no link")

    def kill(self) -> None:
        """End it, as a power cut does: all its processes, and its link."""
        os.kill(self.first, signal.SIGKILL)
        self.process.wait()
        for command in self._commands:
            command.wait()


@contextmanager
def running(
    names: Sequence[str], folders: Mapping[str, Sequence[Path]] | None = None
) -> Iterator[dict[str, Host]]:
    """Start hosts on a network of their own, and remove all at the end.

    Args:
        names: Their names.
        folders: What a host sees in its /tmp beside its own files, by its name.
    """
    with tempfile.TemporaryDirectory() as logs:
        hub = _Space(["--net"], f"ip link add {BRIDGE} type bridge && ip link set {BRIDGE} up")
        hosts: dict[str, Host] = {}
        try:
            for number, name in enumerate(names, start=2):
                shown = (folders or {}).get(name, ())
                hosts[name] = _host(hub, name, f"{NETWORK}.{number}", shown, Path(logs))
            yield hosts
        finally:
            for host in hosts.values():
                if host.process.poll() is None:
                    host.kill()
            hub.process.kill()
            hub.process.wait()


def missing() -> str | None:
    """Return why there can be no hosts here, None if there can."""
    if os.getuid() != 0:
        return "only root may make network namespaces"
    lacking = [name for name in NEEDED if shutil.which(name) is None]
    if lacking:
        return f"{', '.join(lacking)} missing; on Debian: apt-get install iproute2 util-linux"
    tried = subprocess.run(["unshare", "--net", "true"], capture_output=True, encoding="utf-8")
    return tried.stderr.strip() or None


class _Space:
    """Namespaces, held by a process that sleeps in them."""

    def __init__(self, kinds: Sequence[str], script: str) -> None:
        self.process = subprocess.Popen(
            [
                *("setpriv", "--pdeathsig", "KILL"),  # it ends with this process, however that ends
                *("unshare", "--fork", "--kill-child", *kinds),
                *("sh", "-ec", f"{script}; exec sleep inf"),
            ],
            stdin=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,  # util-linux 2.38 complains when it is killed
            start_new_session=True,
        )
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
        deadline = time.monotonic() + SECONDS_TO_START
        while not (found := self._sleeper(children)):
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f"no namespaces: {script}")
            time.sleep(0.02)
        self.first = found

    def _sleeper(self, children: Path) -> int:
        """Return the process that sleeps, 0 while the script is running."""
        try:
            number = int(children.read_text(encoding="ascii").split()[0])
            command = Path(f"/proc/{number}/cmdline").read_text(encoding="utf-8")
            return number if command.startswith("sleep") else 0
        except (OSError, IndexError):
            return 0


def _host(hub: _Space, name: str, address: str, shown: Sequence[Path], logs: Path) -> Host:
    lines = [f"hostname {name}"]
    kept = [f"/run/kept-{number}" for number in range(len(shown))]
    lines += ["mount -t tmpfs tmpfs /run"]
    for path, place in zip(shown, kept, strict=True):
        lines += [f"mkdir {place}", f"mount --bind {shlex.quote(str(path))} {place}"]
    lines += [f"mount -t tmpfs tmpfs {folder}" for folder in ("/tmp", "/dev/shm")]
    for path, place in zip(shown, kept, strict=True):
        target = shlex.quote(str(path))
        lines += [f"mkdir -p {target}", f"mount --bind {place} {target}"]
    kinds = ["--net", "--mount", "--uts", "--ipc", "--pid", "--mount-proc"]
    space = _Space(kinds, " && ".join(lines))
    ip = ["nsenter", "-t", str(hub.first), "--net", "ip"]
    for arguments in (
        f"link add {name} type veth peer name {LINK} netns {space.first}",
        f"link set {name} master {BRIDGE} up",
    ):
        subprocess.run([*ip, *arguments.split()], check=True)
    ip = ["nsenter", "-t", str(space.first), "--net", "ip"]
    for arguments in ("link set lo up", f"addr add {address}/24 dev {LINK}", f"link set {LINK} up"):
        subprocess.run([*ip, *arguments.split()], check=True)
    return Host(name, address, space.process, space.first, logs)


def _enter(first: int) -> list[str]:
    return ["nsenter", "-t", str(first), "--net", "--mount", "--uts", "--ipc", "--pid"]


def _environment() -> dict[str, str]:
    """Return what a command of a host finds set, as after a login."""
    path = os.pathsep.join(["/usr/local/bin", "/usr/bin", "/bin", "/usr/sbin", "/sbin"])
    return {"PATH": path, "HOME": "/tmp", "LANG": "C.UTF-8"}

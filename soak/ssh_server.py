"""An OpenSSH server of one's own on a host of `soak.hosts`, and the keys to it.

It is the one that Debian and Ubuntu install (`sudo apt-get install openssh-server`).
"""

import os
import pwd
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from soak.hosts import Host

PROGRAM = shutil.which("sshd", path="/usr/sbin:/usr/local/sbin")
MISSING = "OpenSSH's server is not installed; on Debian: sudo apt-get install openssh-server"
PORT = 2222
SETTINGS = {
    "Port": PORT,
    "PidFile": "none",
    "PasswordAuthentication": "no",
    "KbdInteractiveAuthentication": "no",
    "UsePAM": "no",
    "StrictModes": "no",  # of the folder above the keys, which others may write to
    "Subsystem": "sftp internal-sftp",
}


@dataclass(frozen=True)
class Keys:
    """A folder with the server's key, and the one that opens it.

    Attributes:
        folder: Where they are, also on the hosts.
    """

    folder: Path

    @property
    def user(self) -> Path:
        """The private key of who may log in."""
        return self.folder / "user"

    def make(self) -> None:
        """Make both pairs of keys."""
        for name in ("server", "user"):
            command = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(self.folder / name)]
            subprocess.run(command, check=True)

    def use(self, host: Host) -> None:
        """Let clients on a host use them, from the settings that git, DVC and their libraries read.

        OpenSSH looks for these in the user's home, whatever HOME says, DVC in HOME.
        """
        path = self.folder / "client"
        lines = [
            f"IdentityFile {self.user}",
            f"UserKnownHostsFile {self.folder / 'known'}",
            "StrictHostKeyChecking accept-new",
        ]
        path.write_text("\n".join(["Host *", *lines, ""]), encoding="ascii")
        home = f"{pwd.getpwuid(os.getuid()).pw_dir}/.ssh"
        line = (
            f"mkdir -p {home} $HOME/.ssh && mount -t tmpfs tmpfs {home} && "
            f"cp {path} {home}/config && cp {path} $HOME/.ssh/config"
        )
        if host.start("sh", "-c", line).wait():
            raise RuntimeError(host.log.read_text(encoding="utf-8"))


def start(host: Host, keys: Keys) -> None:
    """Start the server on a host, which runs it until its end."""
    settings = {
        "ListenAddress": host.address,
        "HostKey": keys.folder / "server",
        "AuthorizedKeysFile": keys.folder / "user.pub",
    } | SETTINGS
    path = keys.folder / "config"
    lines = (f"{name} {value}\n" for name, value in settings.items())
    path.write_text("".join(lines), encoding="ascii")
    host.start("sh", "-c", f"mkdir -p /run/sshd && exec {PROGRAM} -D -e -f {path}")

"""A Ray cluster of one node on the loopback address, without its dashboard."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil


@contextmanager
def started(folder: str, port: int, num_cpus: int = 2) -> Iterator[subprocess.Popen[bytes]]:
    command = [
        *(str(Path(sys.executable).with_name("ray")), "start", "--head", "--block"),
        *("--node-ip-address", "127.0.0.1", "--port", str(port), "--num-cpus", str(num_cpus)),
        *("--include-dashboard", "false", "--temp-dir", folder),
        *("--object-store-memory", str(100 * 2**20)),
    ]
    process = subprocess.Popen(
        command,
        # Workers' niceness is 15 by default: with other tests beside, they would hardly run.
        env=os.environ | {"RAY_worker_niceness": "0"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        while not is_open(port):
            assert process.poll() is None
            time.sleep(0.1)
        yield process
    finally:
        everybody = [psutil.Process(process.pid), *psutil.Process(process.pid).children(True)]
        for one in everybody:
            with suppress(psutil.Error):
                one.kill()
        psutil.wait_procs(everybody, timeout=10)
        process.wait()


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port: int = server.getsockname()[1]
    return port


def is_open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0

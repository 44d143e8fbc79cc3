"""What a process does about garbage, in a process of its own."""

import subprocess
import sys

import pytest

PROGRAM = """
from jumping_ant.base import garbage

class Litter:
    def __init__(self, name):
        self.name, self.itself = name, self

    def __del__(self):
        print(self.name, flush=True)

{setting}
Litter("early")
cycles = [[] for _ in range(10_000)]
print("work", flush=True)
Litter("late")
"""


@pytest.mark.parametrize(
    ("setting", "told"),
    [("", ["early", "work", "late"]), ("garbage.collect_rarely()", ["work"])],
)
def test_little_garbage_is_left_to_the_exit_and_beyond(setting: str, told: list[str]) -> None:
    command = [sys.executable, "-c", PROGRAM.format(setting=setting)]
    done = subprocess.run(command, encoding="utf-8", capture_output=True, check=True)
    assert done.stdout.split() == told

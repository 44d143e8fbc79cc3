"""The OpenGL backend: selected without a screen, remembered, obeyed, and refused in plain words.

A process keeps its backend, so each test asks a fresh one.
"""

import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.sim import gl

SETTINGS = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")

DRAW_AFTER_IMPORTING_MUJOCO = """
import os, sys
import gymnasium, mujoco
import jumping_ant.sim.env
from jumping_ant.sim import gl

assert "MUJOCO_GL" not in os.environ
backend = gl.select_backend()
assert os.environ["MUJOCO_GL"] == backend
sys.executable = "/nonexistent"  # another probe would fail
assert gl.select_backend() == backend
model = mujoco.MjModel.from_xml_string(
    '<mujoco><worldbody><light pos="0 0 3"/><geom size="1"/></worldbody></mujoco>'
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with gl.open_renderer(model, 800, 700) as renderer:
    renderer.update_scene(data)
    picture = renderer.render()
    assert picture.shape == (700, 800, 3) and picture.std() > 1
env = gymnasium.make("JumpingAnt-v0", render_mode="rgb_array", width=64, height=48)
env.reset(seed=0)
picture = env.render()
assert picture.shape == (48, 64, 3) and picture.dtype == "uint8" and picture.std() > 1
env.close()
print(backend)
"""

OPEN = """
import mujoco
from jumping_ant.sim import gl

gl.open_renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 64, 64).close()
"""


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {key: value for key, value in os.environ.items() if key not in SETTINGS}
    return subprocess.run(
        [sys.executable, "-c", code],
        env=clean | environment,
        cwd=PROJECT_ROOT,
        capture_output=True,
        encoding="utf-8",
        timeout=120,
    )


def test_it_draws_though_mujoco_was_imported_before() -> None:
    process = run(DRAW_AFTER_IMPORTING_MUJOCO)
    assert process.returncode == 0, process.stderr
    assert process.stdout.strip() in gl.HEADLESS_BACKENDS
    assert "Traceback" not in process.stderr  # nor at the interpreter's exit


@pytest.mark.parametrize(
    ("environment", "words"),
    [
        ({"MUJOCO_GL": "glfw"}, ["InputError: MUJOCO_GL: given 'glfw'", "allowed: egl, osmesa"]),
        # No backend loads under a foreign platform, as on a machine without their libraries.
        ({"PYOPENGL_PLATFORM": "none"}, ["apt-get install libegl1 libegl-mesa0", "osmesa: "]),
    ],
)
def test_what_draws_nothing_is_refused(environment: dict[str, str], words: list[str]) -> None:
    process = run(OPEN, **environment)
    assert process.returncode == 1
    message = process.stderr.splitlines()[-1]
    assert all(part in message for part in words), message


DRAW_AND_LEARN = """
import gymnasium, torch
import jumping_ant.sim.env

env = gymnasium.make("JumpingAnt-v0", render_mode="rgb_array")
env.reset()
env.render()
torch.optim.Adam([torch.zeros(1, requires_grad=True)])
import triton
print(triton.__file__)
"""


@pytest.mark.long
def test_a_window_without_a_display_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in gl.DISPLAYS:
        monkeypatch.delenv(name, raising=False)
    env = gymnasium.make("jumping_ant.sim.env:JumpingAnt-v0", render_mode="human")
    with pytest.raises(InputError, match="render_mode: given 'human' without a display, allowed"):
        env.reset()


def test_a_picture_goes_with_the_triton_of_builds_for_cuda(tmp_path: Path) -> None:
    """Its LLVM after Mesa's is a segmentation fault."""
    command = ["pip", "install", "--quiet", "--no-deps", "--target", str(tmp_path), "triton==3.7.1"]
    subprocess.run([sys.executable, "-m", *command], check=True)
    process = run(DRAW_AND_LEARN, PYTHONPATH=str(tmp_path))
    assert process.returncode == 0, process.stderr
    assert process.stdout.startswith(str(tmp_path))

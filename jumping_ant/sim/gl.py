"""Select the OpenGL backend for rendering without a screen, once per process.

MuJoCo reads `MUJOCO_GL` when it is imported and, if it is not set, uses GLFW, which needs a screen.
`select_backend` corrects this before the first picture, also for Gymnasium and child processes.

Mesa's software renderer and triton, which comes with torch's builds for CUDA and is imported by its
optimisers, each hold an LLVM. Triton's must come first: the other order is a segmentation fault.
"""

import functools
import importlib
import os
import subprocess
import sys
from contextlib import suppress
from copy import copy
from typing import Any

import mujoco
from mujoco.rendering.classic import gl_context

from jumping_ant.base.errors import InputError

DISPLAYS = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")  # variables that name one
HEADLESS_BACKENDS = ("egl", "osmesa")  # in order of preference

# An installed library may draw nothing or crash the process, so each is tried in a subprocess.
_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string('<mujoco><worldbody><geom size="1"/></worldbody></mujoco>')
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
with mujoco.Renderer(model, 32, 32) as renderer:
    renderer.update_scene(data)
    if renderer.render().max() == 0:
        raise SystemExit("a black picture")
"""
_PROBE_SECONDS = 60


@functools.cache
def select_backend() -> str:
    """Make off-screen rendering work in this process; return `MUJOCO_GL`.

    A value of it is obeyed. Otherwise, on Linux, it becomes the first headless backend that draws a
    picture in another process, or an `InputError` is raised; other systems use their OpenGL.
    """
    if not os.environ.get("MUJOCO_GL") and sys.platform == "linux":
        os.environ["MUJOCO_GL"] = _first_that_draws()
    importlib.reload(gl_context)  # it read the variable when mujoco was imported
    return os.environ.get("MUJOCO_GL", "")


def has_display() -> bool:
    """Tell whether windows can open; systems other than Linux are taken to have a display."""
    return sys.platform != "linux" or any(map(os.environ.get, DISPLAYS))


def open_renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """Open an off-screen renderer; use it as a context manager, so that it is closed."""
    backend = select_backend()
    _prepare(model, width, height)
    try:
        return mujoco.Renderer(model, height, width)
    except (ImportError, AttributeError, RuntimeError, mujoco.FatalError) as error:
        raise InputError(
            f"MUJOCO_GL: given {backend!r}, which draws nothing here ({error}); allowed: "
            f"{', '.join(HEADLESS_BACKENDS)}, or leave it unset to take the first that works"
        ) from error


def gymnasium_renderer(model: mujoco.MjModel, width: int, height: int, off_screen: bool) -> Any:
    """Return Gymnasium's renderer of a copy of a robot, on a camera named `track`, if any."""
    # Imported here because films do not need it.
    from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer

    if off_screen:
        select_backend()
    elif not has_display():  # the library would end the process
        raise InputError(
            f"render_mode: given 'human' without a display, allowed: rgb_array, or a display "
            f"({', '.join(DISPLAYS)})"
        )
    model = copy(model)
    _prepare(model, width, height)
    camera = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, "track")
    data = mujoco.MjData(model)
    return MujocoRenderer(model, data, width=width, height=height, camera_id=camera)


def _prepare(model: mujoco.MjModel, width: int, height: int) -> None:
    """Import triton, where it is installed, before OpenGL; make room for pictures."""
    with suppress(ImportError):
        importlib.import_module("triton")
    visual = model.vis.global_
    visual.offwidth = max(visual.offwidth, width)
    visual.offheight = max(visual.offheight, height)


def _first_that_draws() -> str:
    faults = []
    for backend in HEADLESS_BACKENDS:
        environment = os.environ | {"MUJOCO_GL": backend}
        command = ["timeout", str(_PROBE_SECONDS), sys.executable, "-c", _PROBE]
        probe = subprocess.run(command, env=environment, capture_output=True, encoding="utf-8")
        if probe.returncode == 0:
            return backend
        fault = probe.stderr.strip() or f"exit status {probe.returncode}"
        faults.append(f"{backend}: {fault.splitlines()[-1]}")
    raise InputError(
        "rendering: no OpenGL backend works without a screen here. Install one, on Debian and "
        "Ubuntu with `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0`; everything "
        f"else works without it. Tried {'; '.join(faults)}"
    )

"""Select the OpenGL backend for rendering without a screen, once per process.

MuJoCo reads the environment variable `MUJOCO_GL` when it is imported. If it is not set, MuJoCo uses
GLFW, which needs a screen. `select_backend` corrects this at any time before the first picture. It
stores its choice in `MUJOCO_GL`, where Gymnasium's renderer and child processes find it.

Mesa's software renderer and triton, which comes with torch's builds for CUDA and is imported by its
optimisers, each hold an LLVM. Triton's must come first: the other order is a segmentation fault.
"""

import functools
import importlib
import os
import subprocess
import sys
from contextlib import suppress
from typing import Any

import mujoco
from mujoco.rendering.classic import gl_context

from jumping_ant.base.errors import InputError

HEADLESS_BACKENDS = ("egl", "osmesa")  # in order of preference

# An installed library may draw nothing or crash the process, so each is tried in a subprocess.
_PROBE = """
import mujoco
model = mujoco.MjModel.from_xml_string(
    '<mujoco><visual><quality shadowsize="0"/></visual>'
    '<worldbody><geom size="1"/></worldbody></mujoco>'
)
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
    """Make off-screen rendering work in this process, whatever was imported before.

    If `MUJOCO_GL` is already set, it is used. Otherwise, on Linux, each headless backend draws a
    picture in its own process, and the first that succeeds is used; other systems use their own
    OpenGL. The result is the value of `MUJOCO_GL`, empty if the system's own is used.
    """
    if not os.environ.get("MUJOCO_GL") and sys.platform == "linux":
        os.environ["MUJOCO_GL"] = _first_that_draws()
    importlib.reload(gl_context)  # it read the variable when mujoco was imported
    return os.environ.get("MUJOCO_GL", "")


def open_renderer(model: mujoco.MjModel, width: int, height: int) -> mujoco.Renderer:
    """Open an off-screen renderer; use it as a context manager, so that it is closed."""
    backend = select_backend()
    _load_triton()
    visual = model.vis.global_
    visual.offwidth = max(visual.offwidth, width)
    visual.offheight = max(visual.offheight, height)
    try:
        return mujoco.Renderer(model, height, width)
    except (ImportError, AttributeError, RuntimeError, mujoco.FatalError) as error:
        raise InputError(
            f"MUJOCO_GL: given {backend!r}, which draws nothing here ({error}); allowed: "
            f"{', '.join(HEADLESS_BACKENDS)}, or leave it unset to take the first that works"
        ) from error


def gymnasium_renderer(
    model: mujoco.MjModel, data: mujoco.MjData, width: int, height: int, off_screen: bool = True
) -> Any:
    """Return Gymnasium's renderer, off screen or a window, on a camera named `track`, if any."""
    # Imported here because films do not need it.
    from gymnasium.envs.mujoco.mujoco_rendering import MujocoRenderer

    if off_screen:
        select_backend()
    _load_triton()
    visual = model.vis.global_
    visual.offwidth = max(visual.offwidth, width)
    visual.offheight = max(visual.offheight, height)
    camera = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, "track")
    return MujocoRenderer(model, data, width=width, height=height, camera_id=camera)


def _load_triton() -> None:
    """Import triton before there is an OpenGL context, where it is installed (0.3 s)."""
    with suppress(ImportError):
        importlib.import_module("triton")


def _first_that_draws() -> str:
    faults = []
    for backend in HEADLESS_BACKENDS:
        fault = _probe(backend)
        if fault is None:
            return backend
        faults.append(f"{backend}: {fault}")
    raise InputError(
        "rendering: no OpenGL backend works without a screen here. Install one, on Debian and "
        "Ubuntu with `apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri libopengl0`; everything "
        f"else works without it. Tried {'; '.join(faults)}"
    )


def _probe(backend: str) -> str | None:
    """Return why a backend does not draw, or None if it does."""
    try:
        probe = subprocess.run(
            [sys.executable, "-c", _PROBE],
            env=os.environ | {"MUJOCO_GL": backend},
            capture_output=True,
            encoding="utf-8",
            timeout=_PROBE_SECONDS,
        )
    except subprocess.TimeoutExpired:
        return f"no picture in {_PROBE_SECONDS} s"
    if probe.returncode == 0:
        return None
    lines = probe.stderr.strip().splitlines()
    return lines[-1] if lines else f"exit status {probe.returncode}"

"""The robot's parts in a recording: their names, limbs and colours."""

import numpy as np
from numpy.typing import NDArray

from jumping_ant.sim.world import World

Color = tuple[int, ...]

FLOOR_COLOR: Color = (52, 62, 76)
TORSO_COLOR: Color = (232, 222, 204)
# One colour per leg, in the order of the bodies; the legs' shapes, arrows and series share it.
LEG_COLORS: tuple[Color, ...] = ((240, 120, 90), (250, 195, 80), (90, 190, 170), (130, 140, 245))


def body_names(world: World) -> list[str]:
    """Return the bodies' names; an unnamed one, the tip of a leg, is its parent's foot."""
    model = world.model
    names = [model.body(index).name for index in range(model.nbody)]
    for index, name in enumerate(names):
        if not name:
            names[index] = f"{names[model.body_parentid[index]]}_foot"
    return names


def geom_paths(world: World) -> list[str]:
    """Return the entity path of every geom; an unnamed one is numbered."""
    model, bodies = world.model, body_names(world)
    paths = []
    for index in range(model.ngeom):
        name = model.geom(index).name or f"geom_{index}"
        body = model.geom_bodyid[index]
        paths.append(f"world/{bodies[body]}/{name}" if body else f"world/{name}")
    return paths


def limb_names(world: World) -> list[str]:
    """Return the names of the limbs: the torso and the legs that begin at it."""
    names = body_names(world)
    return [names[body] for body in _limb_roots(world)]


def limb_color(limb: int) -> Color:
    """Return the colour of a limb, by its number among `limb_names`."""
    return TORSO_COLOR if limb == 0 else LEG_COLORS[(limb - 1) % len(LEG_COLORS)]


def limbs_of_bodies(world: World) -> NDArray[np.int64]:
    """Return the number of each body's limb, -1 for the world, shape (num_bodies,)."""
    model, roots = world.model, _limb_roots(world)
    limbs = np.full(model.nbody, -1)
    for body in range(1, model.nbody):  # a parent comes before its children
        limbs[body] = roots.index(body) if body in roots else limbs[model.body_parentid[body]]
    return limbs


def limbs_of_motors(world: World) -> NDArray[np.int64]:
    """Return the number of the limb that each motor moves, shape (num_motors,)."""
    return limbs_of_bodies(world)[world.model.jnt_bodyid[world.anatomy.motor_joints]]


def _limb_roots(world: World) -> list[int]:
    torso = world.anatomy.torso
    return [torso, *np.flatnonzero(world.model.body_parentid == torso).tolist()]

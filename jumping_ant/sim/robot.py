"""The jumping Ant: Gymnasium's Ant with a lighter body and stronger legs.

The source is `ant.xml` of the installed Gymnasium (Schulman et al. 2016, "High-Dimensional
Continuous Control Using Generalized Advantage Estimation", appendix). Each edit is one small step
on a `mujoco.MjSpec`, by element name.
"""

import hashlib
import importlib.metadata
from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco

from jumping_ant.base.errors import InputError
from jumping_ant.base.paths import Paths
from jumping_ant.params.models import RobotParams

SOURCE_PATH = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "ant.xml"
TORSO = "torso"
FLOOR = "floor"
FILES = {"edited": "jumping_ant.xml", "unedited": "ant.xml"}  # in assets/


def build(params: RobotParams) -> str:
    """Return the edited robot as MJCF.

    The actuators, nameless in the source, get the names of the joints they drive.

    Raises:
        InputError: `joint_gear` names no joint kind or joint of the robot, or the edits together
            make a robot that MuJoCo cannot compile.
    """
    spec = mujoco.MjSpec.from_file(str(SOURCE_PATH))
    spec.modelname = "jumping_ant"
    # Values stand in the text as in the source, not as compiled and rounded to six digits.
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    _set_density(spec, params.density)
    _set_gear(spec, params.gear, params.joint_gear)
    _set_torso_radius(spec, params.torso_radius)
    _scale_legs(spec, params.leg_length)
    _set_damping(spec, params.damping)
    _set_friction(spec, params.friction, params.torsional_friction, params.rolling_friction)
    try:
        spec.compile()
    except ValueError as error:
        raise InputError(f"robot: these edits do not compile: {error}") from error
    return spec.to_xml()


def unedited() -> str:
    """Return Gymnasium's Ant as it comes, as MJCF; its actuators get names alone."""
    spec = mujoco.MjSpec.from_file(str(SOURCE_PATH))
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    for actuator in spec.actuators:
        actuator.name = actuator.target
    spec.compile()
    return spec.to_xml()


def read(root: Path, kind: Literal["edited", "unedited"] = "edited") -> str:
    """Return a robot of a project, as MJCF text.

    Args:
        root: The project's folder.
        kind: The jumping Ant, or Gymnasium's.

    Raises:
        InputError: The robot has not been built.
    """
    path = Paths(root).assets / FILES[kind]
    try:
        return path.read_text()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; `dvc repro build` writes it") from error


def load(xml: str) -> mujoco.MjModel:
    """Compile a robot for simulation.

    MuJoCo's automatic reset of diverged states is switched off: a state that is not finite ends
    its episode instead of silently starting a new one. So is the search for constraint islands:
    one robot is one island, and without the search the same states come 5 % sooner.

    Args:
        xml: MJCF text.

    Raises:
        InputError: The text is not MJCF that compiles, or not a robot with the Ant's joints.
    """
    try:
        model = mujoco.MjModel.from_xml_string(xml)
    except ValueError as error:
        raise InputError(f"robot XML: not valid MJCF: {' '.join(str(error).split())}") from error
    if (model.nq, model.nv, model.nu) != (15, 14, 8):
        raise InputError(
            f"robot XML: given {model.nq} positions, {model.nv} velocities, {model.nu} motors; "
            "allowed: the Ant's 15, 14, 8"
        )
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    return model


def summarize(xml: str) -> dict[str, Any]:
    """Return what the edits changed, physically.

    Args:
        xml: The edited robot.

    Returns:
        `before` and `after`, each with the total mass [kg], the mass of every body [kg], the peak
        torque of every motor [N m], and the summed peak torque over the weight [m], beside the
        source's digest and the versions that made the file.
    """
    return {
        "source": {
            "file": f"gymnasium/envs/mujoco/assets/{SOURCE_PATH.name}",
            "sha256": hashlib.sha256(SOURCE_PATH.read_bytes()).hexdigest(),
        },
        "versions": {name: importlib.metadata.version(name) for name in ("gymnasium", "mujoco")},
        "before": _physique(SOURCE_PATH.read_text()),
        "after": _physique(xml),
    }


def _physique(xml: str) -> dict[str, Any]:
    spec = mujoco.MjSpec.from_string(xml)
    model = spec.compile()
    mass = float(model.body_subtreemass[0])
    weight = mass * float(abs(model.opt.gravity[2]))
    torques = {
        actuator.target: float(actuator.gear[0] * max(abs(actuator.ctrlrange)))
        for actuator in spec.actuators
    }
    return {
        "mass": mass,
        "body_mass": {
            body.name or f"{body.parent.name}_foot": float(model.body_mass[body.id])
            for body in spec.bodies
            if body.id > 0
        },
        "peak_torque": torques,
        "peak_torque_over_weight": sum(torques.values()) / weight,
    }


def _robot_geoms(spec: mujoco.MjSpec) -> list[mujoco.MjsGeom]:
    return [geom for geom in spec.geoms if geom.name != FLOOR]


def _set_density(spec: mujoco.MjSpec, density: float) -> None:
    """Set the density of every part [kg/m^3]."""
    spec.default.geom.density = density
    for geom in spec.geoms:
        geom.density = density


def _set_gear(spec: mujoco.MjSpec, gear: float, joint_gear: dict[str, float]) -> None:
    """Set the peak torque of every motor [N m]; a joint's own entry wins over its kind's."""
    joints = [actuator.target for actuator in spec.actuators]
    kinds = dict.fromkeys(joint.partition("_")[0] for joint in joints)
    allowed = [*kinds, *sorted(joints)]
    for name in joint_gear:
        if name not in allowed:
            raise InputError(
                f"robot.joint_gear.{name}: unknown joint; allowed: {', '.join(allowed)}"
            )
    for actuator in spec.actuators:
        kind = actuator.target.partition("_")[0]
        actuator.name = actuator.target
        actuator.gear[0] = joint_gear.get(actuator.target, joint_gear.get(kind, gear))


def _set_torso_radius(spec: mujoco.MjSpec, radius: float) -> None:
    """Set the radius of the torso's sphere [m]."""
    spec.geom("torso_geom").size[0] = radius


def _scale_legs(spec: mujoco.MjSpec, factor: float) -> None:
    """Scale every leg segment, and where the next one begins, about its joint."""
    for geom in _robot_geoms(spec):
        geom.fromto = geom.fromto * factor  # not a number, and so unchanged, for the torso
    for body in spec.bodies:
        if body.name not in ("world", TORSO):
            body.pos = body.pos * factor


def _set_damping(spec: mujoco.MjSpec, damping: float) -> None:
    """Set the damping of every hinge [N m s/rad]; the torso moves freely."""
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            joint.damping[0] = damping


def _set_friction(spec: mujoco.MjSpec, sliding: float, torsional: float, rolling: float) -> None:
    """Set the friction of every part and of the floor (MuJoCo takes the larger of two)."""
    for geom in spec.geoms:
        geom.friction = [sliding, torsional, rolling]

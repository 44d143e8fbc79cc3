"""Robots: an MJCF source and its edits.

A source is a robot of the installed Gymnasium or a file in the project's `robots/`. By default it
is Gymnasium's Ant (Schulman et al. 2016, "High-Dimensional Continuous Control Using Generalized
Advantage Estimation", appendix); lighter parts and stronger motors enable it to jump. Each named
edit is one small step on a `mujoco.MjSpec`; `edits` sets any other attribute in the text.
"""

import fnmatch
import hashlib
import importlib.metadata
import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.params.blocks import GYMNASIUM_ROBOTS, RobotParams
from jumping_ant.sim import mjcf

GYMNASIUM_ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
FILES = {"edited": "edited.xml", "unedited": "unedited.xml"}  # in assets/


def source_path(source: str, root: Path = PROJECT_ROOT) -> Path:
    """Return the path of the MJCF file of `robot.source`."""
    folder = GYMNASIUM_ASSETS if source in GYMNASIUM_ROBOTS else root
    path = folder / GYMNASIUM_ROBOTS.get(source, source)
    if not os.path.isfile(path):  # also false for a name that is too long
        files = sorted(str(file.relative_to(root)) for file in (root / "robots").glob("*.xml"))
        raise InputError(
            f"robot.source: given {source!r}, which is not a file, allowed: "
            f"{', '.join([*GYMNASIUM_ROBOTS, *files])}"
        )
    return path


def build(params: RobotParams, root: Path = PROJECT_ROOT) -> str:
    """Return the edited robot as MJCF; actuators without a name are named after their joints."""
    spec = _read(params.source, root)
    spec.modelname = f"jumping_{Path(params.source).stem}"
    _set_geoms(spec, params)
    _set_gear(spec, params.gear, params.joint_gear)
    limbs = [body for body in spec.bodies if body.parent and body.parent.parent]  # not the torso
    if params.leg_length is not None:
        _scale(limbs, params.leg_length)
    for joint in (joint for body in limbs for joint in body.joints):
        if params.damping is not None and joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            joint.damping[0] = params.damping
    mjcf.compiled(spec, "robot: these edits do not compile")
    return _edit(spec.to_xml(), params.edits)


def unedited(params: RobotParams, root: Path = PROJECT_ROOT) -> str:
    """Return the source as MJCF, unchanged except that actuators without a name get one."""
    spec = _read(params.source, root)
    mjcf.compiled(spec, f"robot.source: {params.source}")
    return spec.to_xml()


def read(root: Path, kind: Literal["edited", "unedited"] = "edited") -> str:
    """Return a robot of a project, as MJCF text."""
    path = Paths(root).assets / FILES[kind]
    try:
        return mjcf.content(path).decode()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", error)
        raise InputError(f"robot XML: {path}: {reason}; `dvc repro build` writes it") from error


def load(xml: str) -> mujoco.MjModel:
    """Compile a robot for simulation."""
    model = mjcf.compiled(mjcf.parse(xml))
    # A state that is not finite ends its episode, and MuJoCo does not silently start another one.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    # One robot is one island: without a search for them, the same states take 5 % less time.
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    with mjcf.answered("robot XML: cannot be simulated"):
        mujoco.mj_step(model, mujoco.MjData(model))
    return model


def body_names(model: mujoco.MjModel) -> list[str]:
    """Return the bodies' names; an unnamed one, the tip of a leg, is its parent's foot."""
    names = [model.body(index).name for index in range(model.nbody)]
    for index in range(model.nbody):
        foot = f"{names[model.body_parentid[index]]}_foot"
        others = (f"{foot}_{number}" for number in range(2, model.nbody + 2))
        names[index] = names[index] or next(it for it in (foot, *others) if it not in names)
    return names


def summarize(params: RobotParams, xml: str, root: Path = PROJECT_ROOT) -> dict[str, Any]:
    """Return what edits change: masses [kg], peak torques [N m], and their sum over weight [m]."""
    path = source_path(params.source, root)
    is_gymnasium = params.source in GYMNASIUM_ROBOTS
    file = f"gymnasium/envs/mujoco/assets/{path.name}" if is_gymnasium else params.source
    return {
        "source": {"file": file, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()},
        "versions": {name: importlib.metadata.version(name) for name in ("gymnasium", "mujoco")},
        "before": _physique(_read(params.source, root)),
        "after": _physique(mjcf.parse(xml)),
    }


def _read(source: str, root: Path) -> mujoco.MjSpec:
    """Read a source; actuators without a name are named after what they drive."""
    path = source_path(source, root)
    if source in GYMNASIUM_ROBOTS:
        spec = mjcf.parse(path.read_text(encoding="utf-8"), f"robot.source: {source}")
    else:
        spec = mjcf.read(path, root / "robots")
    # Keep values in the text as in the source, not compiled and rounded to six digits.
    spec.compiler.savecompiled = spec.compiler.savecanonical = False
    with mjcf.answered(f"robot.source: {source}"):  # two may drive one joint
        for actuator in spec.actuators:
            actuator.name = actuator.name or actuator.target
    return spec


def _edit(xml: str, edits: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Set attributes in MJCF text, by element and name pattern (shell wildcards: * and ?)."""
    if not edits:
        return xml
    tree = ET.fromstring(xml)
    for element, patterns in edits.items():
        # Tendons and equations name parts by elements called alike, of other attributes.
        named = element in ("joint", "geom", "site", "tendon")
        apart = ("fixed", "spatial", "equality") if named else ()
        parents = (each for each in tree.iter() if each.tag not in apart)
        elements = [each for parent in parents for each in parent if each.tag == element]
        if not elements:
            kinds = ", ".join(sorted({each.tag for each in tree.iter()}))
            raise InputError(f"robot.edits.{element}: no such element; allowed: {kinds}")
        names = [each.get("name", each.get("class", "")) for each in elements]
        for pattern, attributes in patterns.items():
            key = f"robot.edits.{element}.{pattern}"
            matching = fnmatch.filter(names, pattern)
            if not matching:
                allowed = ", ".join(filter(None, names)) or "*, because none has a name"
                raise InputError(f"{key}: matches no name; allowed: {allowed}")
            if odd := [name for name in attributes if not re.fullmatch(r"[A-Za-z_]\w*", name)]:
                raise InputError(f"{key}: given {odd[0][:40]!r}, allowed: names of attributes")
            with mjcf.answered(key):  # Python writes no integer of more than 4300 digits
                texts = {name: _text(value) for name, value in attributes.items()}
            for each, name in zip(elements, names, strict=True):
                if name in matching:
                    each.attrib |= texts
            # One at a time, so that the message can name the edit.
            spec = mjcf.parse(ET.tostring(tree, encoding="unicode"), key)
            mjcf.compiled(spec, f"{key}: does not compile")
    return ET.tostring(tree, encoding="unicode") + "\n"


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return " ".join(map(repr, value))
    return str(value)


def _physique(spec: mujoco.MjSpec) -> dict[str, Any]:
    model = mjcf.compiled(spec)
    mass = float(model.body_subtreemass[0])
    weight = mass * float(abs(model.opt.gravity[2]))
    torques = {
        actuator.name: float(actuator.gear[0]) * _control_limit(actuator)
        for actuator in spec.actuators
    }
    torque = sum(torques.values())
    if not (0 < weight < math.inf and math.isfinite(torque)):
        raise InputError(
            f"robot: given a weight of {weight:g} N and peak torques of {torque:g} N m in all, "
            "allowed: finite numbers, and a weight above 0"
        )
    return {
        "mass": mass,
        "body_mass": dict(list(zip(body_names(model), model.body_mass.tolist(), strict=True))[1:]),
        "peak_torque": torques,
        "peak_torque_over_weight": torque / weight,
    }


def _set_geoms(spec: mujoco.MjSpec, params: RobotParams) -> None:
    """Set density, friction and margin of all geoms, and the radius of the torso's.

    For two geoms in contact, MuJoCo uses the larger friction, and the sum of the margins (until
    version 3.3 the larger one).
    """
    if params.density is not None:
        spec.compiler.settotalmass = -1.0  # it would override the density
        spec.default.geom.density = params.density
    margin = params.contact_margin
    values = {"density": params.density, "friction": params.friction, "margin": margin}
    for geom in spec.geoms:
        for name, value in values.items():
            if value is not None:
                setattr(geom, name, value)
    if params.torso_radius is not None:
        if (sphere := spec.geom("torso_geom")) is None:
            raise InputError(
                "robot.torso_radius: this robot has no geom named torso_geom; allowed: null; "
                "use robot.edits for other geoms"
            )
        sphere.size[0] = params.torso_radius


def _set_gear(spec: mujoco.MjSpec, gear: float | None, joint_gear: Mapping[str, float]) -> None:
    """Set the peak torque of every motor [N m]; a joint's entry overrides that of its kind."""
    joints = [actuator.target for actuator in spec.actuators]
    kinds = dict.fromkeys(joint.partition("_")[0] for joint in joints)
    allowed = dict.fromkeys([*kinds, *sorted(joints)])
    for name in joint_gear:
        if name not in allowed:
            raise InputError(
                f"robot.joint_gear.{name}: unknown joint; allowed: {', '.join(allowed)}"
            )
    for actuator in spec.actuators:
        kind = actuator.target.partition("_")[0]
        torque = joint_gear.get(actuator.target, joint_gear.get(kind, gear))
        if torque is not None:
            actuator.gear[0] = torque / _control_limit(actuator)


def _control_limit(actuator: mujoco.MjsActuator) -> float:
    """Return a motor's largest control, 1 if it has no limit."""
    return float(max(abs(actuator.ctrlrange))) or 1.0


def _scale(limbs: list[mujoco.MjsBody], factor: float) -> None:
    """Scale segments, and the start of the next one, about their joints."""
    for body in limbs:
        body.pos = body.pos * factor
        for geom in body.geoms:
            if geom.fromto[0] == geom.fromto[0]:  # not NaN
                geom.fromto = geom.fromto * factor
            else:
                geom.pos, geom.size[1] = geom.pos * factor, geom.size[1] * factor

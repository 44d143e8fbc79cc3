"""MJCF that someone else may have written, read so that it can neither open files nor fill memory.

MuJoCo opens any file that MJCF names, reserves any memory that it asks for, and has an XML parser
that may understand a text otherwise than a check does. Therefore it never gets a text or a path
from outside: this module parses it, inserts what it includes, checks every element, and gives
MuJoCo the text that it writes from the result.
"""

import math
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from fnmatch import fnmatchcase
from pathlib import Path
from xml.parsers import expat

import mujoco

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import regular

MOST_BYTES = 2**20  # of a robot with all its files; Gymnasium's largest has 12 kB
MOST_ELEMENTS = 1000  # each as often as it is repeated; Gymnasium's largest robot has 94
MOST_DEPTH = 50  # of elements inside each other
MOST_FILES = 50
MOST_PIXELS = 2**24  # of all textures
TIMESTEPS = (1e-5, 1.0)  # [s] of the simulation
MOST_MEMORY = 2**28  # [bytes] of a compiled robot and of one simulation's contacts; Ant's: 15 MB
LARGEST = {  # whole numbers that size anything, or repeat work, by element and attribute
    "* actdim": 100,
    "* nsample": 100,
    "camera resolution": 8192,
    "contact num": 10,
    "global off*": 8192,
    "numeric size": 1000,
    "option *iterations": 200,
    "option sdf_initpoints": 200,
    "quality num*": 100,
    "quality offsamples": 16,
    "quality shadowsize": 8192,
    "replicate count": MOST_ELEMENTS,
    "size memory": 2**27,
    "size nconmax": 10_000,
    "size njmax": 2000,  # the memory grows with its square
    "size nkey": 100,
    "size nstack": 2**24,
    "size nuser_*": 100,
    "size nuserdata": 10_000,
    "texture gridsize": 12,
    "texture height": 8192,
    "texture nchannel": 4,
    "texture width": 8192,
}
# Whatever is missing here reads files, runs plugins or generates shapes (mesh, hfield, skin, flex,
# model, attach), or simulates for long before the first step (muscle, lengthrange).
_NAMES = """
    mujoco mujocoinclude include compiler option flag size statistic
    visual global quality headlight map scale rgba
    default asset texture material layer
    worldbody body frame replicate inertial joint freejoint geom site camera light
    contact pair exclude tendon spatial fixed pulley equality connect weld
    actuator general motor position velocity intvelocity pid damper cylinder adhesion dcmotor
    custom numeric text tuple element keyframe key
    sensor touch accelerometer velocimeter gyro force torque magnetometer camprojection
    jointpos jointvel jointactuatorfrc jointlimitpos jointlimitvel jointlimitfrc
    tendonpos tendonvel tendonactuatorfrc tendonlimitpos tendonlimitvel tendonlimitfrc
    actuatorpos actuatorvel actuatorfrc ballquat ballangvel
    framepos framequat framexaxis frameyaxis framezaxis framelinvel frameangvel framelinacc
    frameangacc subtreecom subtreelinvel subtreeangmom insidesite distance normal fromto
    e_potential e_kinetic clock
"""
ELEMENTS = frozenset(_NAMES.split())
_MUJOCO_ERRORS = (mujoco.FatalError, mujoco.UnexpectedError)


def read(path: Path, folder: Path) -> mujoco.MjSpec:
    """Read a robot from a file, with those it includes; all must be in the folder."""
    tree = _Reading(path.parent, folder.resolve()).file(path, ("mujoco",))
    return _spec(tree, f"robot.source: {path.name}")


def parse(xml: str, where: str = "robot XML") -> mujoco.MjSpec:
    """Read a robot from text, which must name no file; messages call it `where`."""
    text = xml.encode(errors="surrogatepass")  # halves of characters are refused later
    return _spec(_Reading().tree(text, where, ("mujoco",)), where)


def compiled(spec: mujoco.MjSpec, where: str = "robot XML: not valid MJCF") -> mujoco.MjModel:
    """Compile a robot, unless it is too large."""
    pixels = sum(
        texture.width * max(texture.height, 6 * texture.width) for texture in spec.textures
    )
    if pixels > MOST_PIXELS:
        raise InputError(f"{where}: given {pixels:,} pixels of texture, allowed: {MOST_PIXELS:,}")
    with answered(where):
        model = spec.compile()
    if (size := model.nbuffer + model.narena) > MOST_MEMORY:
        raise InputError(
            f"{where}: given a robot of {size:,} bytes in memory, allowed: {MOST_MEMORY:,}"
        )
    if not TIMESTEPS[0] <= model.opt.timestep <= TIMESTEPS[1]:
        given = f"given a time step of {model.opt.timestep:g} s"
        raise InputError(f"{where}: {given}, allowed: {TIMESTEPS[0]:g} to {TIMESTEPS[1]:g}")
    return model


@contextmanager
def answered(where: str) -> Iterator[None]:
    """Raise whatever MuJoCo raises about a robot as an `InputError` of one line."""
    try:
        yield
    except (ValueError, RuntimeError, MemoryError, *_MUJOCO_ERRORS) as error:
        raise InputError(f"{where}: {' '.join(str(error).split())[:1000]}") from error


def content(path: Path) -> bytes:
    """Return a regular file's content, at most a byte more than allowed, or raise OSError."""
    with regular(path) as file:
        return file.read(MOST_BYTES + 1)


class _Reading:
    """One robot being read: a text, or files in a folder."""

    def __init__(self, beside: Path = Path(), folder: Path | None = None) -> None:
        self._beside = beside  # the first file's folder, where MuJoCo looks for includes first
        self._folder = folder
        self._seen: set[Path] = set()
        self._num_bytes = 0

    def file(self, path: Path, roots: tuple[str, ...]) -> ET.Element:
        """Return a file as a tree, with what it includes."""
        where = f"robot.source: {path.name[:60]}"
        try:
            real = path.resolve()
            if self._folder is None or not real.is_relative_to(self._folder):
                raise InputError(
                    f"{where}: given the file {str(real)[:200]!r}, allowed: those in robots/"
                )
            text = content(real)
        except (OSError, RuntimeError) as error:  # RuntimeError: a link to itself
            raise InputError(f"{where}: {getattr(error, 'strerror', error)}") from error
        if real in self._seen or len(self._seen) == MOST_FILES:
            raise InputError(
                f"{where}: given a file twice, or more files, allowed: {MOST_FILES}, each once"
            )
        self._seen.add(real)
        return self.tree(text, where, roots, path.parent)

    def tree(
        self, text: bytes, where: str, roots: tuple[str, ...], beside: Path = Path()
    ) -> ET.Element:
        """Return a text as a tree, with what it includes in place of its includes."""
        self._num_bytes += len(text)
        if self._num_bytes > MOST_BYTES:
            raise InputError(f"{where}: given a file of more than {MOST_BYTES:,} bytes")
        tree = _tree(text, where)
        if tree.tag not in roots:
            raise InputError(
                f"{where}: given the root <{tree.tag:.40}>, allowed: {' or '.join(roots)}"
            )
        for parent in list(tree.iter()):
            for place, child in reversed(list(enumerate(parent))):
                if child.tag == "include":
                    parent[place : place + 1] = self._included(child, where, beside)
        return tree

    def _included(self, include: ET.Element, where: str, beside: Path) -> list[ET.Element]:
        """Return the elements of an included file, all on the include's line."""
        name = include.get("file", "")
        if self._folder is None:
            raise InputError(f"{where}: given an include of {name[:60]!r}, allowed: none")
        if len(include):
            raise InputError(f"{where}: given an include with elements inside, allowed: none")
        paths = [folder / name for folder in (self._beside, beside)]
        path = next(filter(os.path.exists, paths), paths[-1])
        tree = self.file(path, ("mujoco", "mujocoinclude"))
        for element in tree.iter():
            element.text = element.tail = None
        if len(tree):
            tree[-1].tail = include.tail
        return list(tree)


def _tree(text: bytes, where: str) -> ET.Element:
    """Return XML as a tree without text, its elements on their lines, for messages of MuJoCo."""
    parser = expat.ParserCreate()
    builder = ET.TreeBuilder()
    line = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal line
        _check_element(tag, attributes, where)
        if line:
            builder.data("\n" * (parser.CurrentLineNumber - line))
        line = parser.CurrentLineNumber if line else 1  # on which the root stands
        builder.start(tag, attributes)

    def refuse(what: str) -> None:
        raise InputError(f"{where}: given {what}, allowed: elements and comments")

    parser.StartElementHandler = start
    parser.EndElementHandler = builder.end
    parser.StartDoctypeDeclHandler = lambda *_: refuse("a <!DOCTYPE>")
    parser.StartCdataSectionHandler = lambda: refuse("a <![CDATA[ ]]>")
    parser.ProcessingInstructionHandler = lambda target, _: refuse(f"<?{target[:40]}?>")
    try:
        parser.Parse(text.decode("utf-8-sig"), True)  # whatever encoding it declares
    except (expat.ExpatError, UnicodeError) as error:
        raise InputError(f"{where}: not valid MJCF: {error}") from error
    return builder.close()


def _check_element(tag: str, attributes: Mapping[str, str], where: str) -> None:
    """Refuse an element that no robot needs, a file, and a size beyond its limit."""
    for name, value in attributes.items():
        given = f"{where}: given <{tag[:40]} {name[:40]}={value[:60]!r}>"
        if name.startswith("file") and tag != "include":
            raise InputError(f"{given}, allowed: parts without files, such as capsules and boxes")
        if re.search(r"[\x00-\x1f\x7f]", value):
            raise InputError(f"{given}, allowed: text of one line")
        if name in ("gaintype", "biastype") and value.strip() == "muscle":
            raise InputError(f"{given}, allowed: actuators without muscles")
        for pattern, limit in LARGEST.items():
            is_limited = fnmatchcase(f"{tag} {name}", pattern)
            if is_limited and not all(_size(word) <= limit for word in value.split(" ")):
                raise InputError(f"{given}, allowed: whole numbers up to {limit:,}")
    if tag not in ELEMENTS:
        raise InputError(
            f"{where}: given <{tag[:40]}>, allowed: the elements listed in docs/how-it-works.md"
        )


def _size(text: str) -> float:
    """Return a size such as 5, 5M or -1 (MuJoCo chooses); infinity for any other text."""
    if match := re.fullmatch(r"([0-9]{1,15})([kmgtpe]?)", text.lower()):
        return int(match[1]) * 1024 ** " kmgtpe".index(match[2] or " ")
    return -1 if text == "-1" else math.inf


def _check_total(tree: ET.Element, where: str) -> None:
    """Refuse too many elements, each counted as often as it is repeated, and too deep ones."""
    total = 0
    waiting = [(tree, 1, 1)]
    while waiting:
        element, copies, depth = waiting.pop()
        total += copies
        if total > MOST_ELEMENTS:
            raise InputError(
                f"{where}: given more than {MOST_ELEMENTS:,} elements, each counted as often as it "
                "is repeated"
            )
        if depth > MOST_DEPTH:
            raise InputError(f"{where}: given elements nested more than {MOST_DEPTH} deep")
        if element.tag == "replicate":
            copies *= max(1, *(int(_size(word)) for word in element.get("count", "1").split(" ")))
        waiting += [(child, copies, depth + 1) for child in element]


def _spec(tree: ET.Element, where: str) -> mujoco.MjSpec:
    """Give MuJoCo the text of a tree whose elements are checked."""
    _check_total(tree, where)
    with answered(f"{where}: not valid MJCF"):
        return mujoco.MjSpec.from_string(ET.tostring(tree, encoding="unicode"))

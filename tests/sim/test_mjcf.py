"""MJCF of someone else: it names no file beyond the project's robots, and asks for no memory.

Hostile robots are kept here as data, each with what is said about it.
"""

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.sim import mjcf, robot

LEG = '<mujocoinclude><body name="{name}"><geom size="0.1"/>{inside}</body></mujocoinclude>'


def model(inside: str) -> str:
    return f"<mujoco>{inside}<worldbody/></mujoco>"


def asset(inside: str) -> str:
    return model(f"<asset>{inside}</asset>")


def many(inside: str) -> str:
    return f"<mujoco><worldbody>{inside}</worldbody></mujoco>"


# The entity's text ends the DOCTYPE for MuJoCo's own parser, which takes the next element as the
# root and the true one as a comment.
TWO_ROOTS = (
    "<!DOCTYPE mujoco [<!ENTITY e '><mujoco><size memory=\"100G\"/><worldbody/></mujoco><!-- '>]>"
    "<mujoco><worldbody/></mujoco><!-- -->"
)
HOSTILE = {
    "include": (model('<include file="/etc/passwd"/>'), "an include of '/etc/passwd', allowed: n"),
    "include in capitals": (model('<INCLUDE file="/etc/passwd"/>'), "<INCLUDE file='/etc/passwd'>"),
    "mesh": (asset('<mesh file="a.obj"/>'), "<mesh file='a.obj'>, allowed: parts without files"),
    "texture": (asset('<texture file="/dev/zero"/>'), "<texture file='/dev/zero'>, allowed: parts"),
    **{
        f"cube's {side}": (
            asset(f'<texture name="a" type="cube" file{side}="/tmp/pipe.png"/>'),
            f"<texture file{side}='/tmp/pipe.png'>, allowed: parts without files",
        )
        for side in ("right", "left", "up", "down", "front", "back")
    },
    "model": (asset('<model file="/etc/passwd"/>'), "<model file='/etc/passwd'>, allowed: parts"),
    "height field": (asset('<hfield name="a" nrow="9" ncol="9"/>'), "<hfield>, allowed: the el"),
    "built-in mesh": (asset('<mesh builtin="sphere" params="9"/>'), "<mesh>, allowed: the el"),
    "flexible grid": (many('<flexcomp count="999 999 9"/>'), "<flexcomp>, allowed: the elem"),
    "attached": (many('<attach model="a" body="b" prefix="c"/>'), "<attach>, allowed: the el"),
    "plugin": (
        model('<extension><plugin plugin="a"/></extension>'),
        "<extension>, allowed: the el",
    ),
    "URDF": ('<robot name="a"><link name="b"/></robot>', "<robot>, allowed: the el"),
    "included root": ("<mujocoinclude/>", "the root <mujocoinclude>, allowed: mujoco"),
    "two roots": (TWO_ROOTS, "a <!DOCTYPE>, allowed: elements and comments"),
    "DOCTYPE": ("<!DOCTYPE a SYSTEM 'file:///etc/passwd'><mujoco/>", "a <!DOCTYPE>, allowed"),
    "CDATA": (model("<![CDATA[<size memory='100G'/>]]>"), "a <![CDATA[ ]]>, allowed: elements"),
    "instruction": (model("<?php a?>"), "<?php?>, allowed: elements and comments"),
    "namespace": (model('<a:include xmlns:a="b" file="/etc/passwd"/>'), "<a:include file='/etc/"),
    "attribute twice": (model('<size nkey="1" nkey="9"/>'), "duplicate attribute: line 1"),
    "newline in a name": (model('<default class="a&#10;b"/>'), "class='a\\nb'>, allowed: text of"),
    "NUL": ("<mujoco/>\x00", "not valid MJCF: not well-formed"),
    "half a character": ('<mujoco model="\ud800"/>', "not valid MJCF: 'utf-8' codec can't"),
    "nothing": ("", "not valid MJCF: no element found"),
    "half": ("<mujoco>", "not valid MJCF: no element found"),
    "long": ("<mujoco>" + " " * 2**20 + "</mujoco>", "a file of more than 1,048,576 bytes"),
    "deep": (many("<body>" * 80_000 + "</body>" * 80_000), "elements nested more than 50 deep"),
    "wide": (many("<body/>" * 140_000), "more than 1,000 elements"),
    "many copies": (
        many('<replicate count="100"><replicate count="100"><body/></replicate></replicate>'),
        "more than 1,000 elements, each counted as often as it is repeated",
    ),
    "large textures": (
        asset(
            "".join(
                f'<texture name="{name}" builtin="flat" type="cube" width="1800" height="1"/>'
                for name in "abcdefghi"
            )
        ),
        "given 174,960,000 pixels of texture, allowed: 16,777,216",
    ),
    "textures of a class": (
        '<mujoco><default><texture type="cube" builtin="flat" width="8192" height="9"/></default>'
        '<asset><texture name="a"/></asset><worldbody/></mujoco>',
        "given 402,653,184 pixels of texture, allowed: 16,777,216",
    ),
    "muscle": (
        model('<actuator><general gaintype="muscle"/></actuator>'),
        "gaintype='muscle'>, allowed: actuators without muscles",
    ),
    "length range": (
        '<mujoco><compiler><lengthrange inttotal="1e9"/></compiler><worldbody/></mujoco>',
        "<lengthrange>, allowed: the el",
    ),
    "little memory": (
        '<mujoco><size memory="1k"/><worldbody><body><freejoint/><geom size="1"/>'
        + '<body><joint/><geom size="1"/></body>' * 30
        + "</body></worldbody></mujoco>",
        "mj_stackAlloc: out of memory",
    ),
    "many degrees of freedom": (
        many('<body><freejoint/><geom size="1"/></body>' * 330),
        "bytes in memory, allowed: 268,435,456",
    ),
    "crowd": (
        '<mujoco><size memory="2M"/><worldbody><geom type="plane" size="1 1 1"/><body><freejoint/>'
        + '<geom size="1"/>'
        + '<body><joint type="ball"/><geom size="1"/></body>' * 50
        + "</body></worldbody></mujoco>",
        "cannot be simulated: mj_stackAlloc: out of memory",
    ),
    "memory": (model('<size memory="100G"/>'), "memory='100G'>, allowed: whole numbers up to 134"),
    "pixels": (asset('<texture width="100000"/>'), "width='100000'>, allowed: whole numbers up to"),
    **{
        f"size {name}": (
            model(f'<size {name}="2000000000"/>'),
            f"<size {name}='2000000000'>, allowed: whole numbers up to ",
        )
        for name in (
            *("njmax", "nconmax", "nstack", "nkey", "nuserdata", "nuser_body", "nuser_geom"),
            *("nuser_jnt", "nuser_site", "nuser_cam", "nuser_tendon", "nuser_actuator"),
            "nuser_sensor",
        )
    },
    **{
        f"number {number!r}": (
            model(f'<size nkey="{number}"/>'),
            f"<size nkey={number!r}>, allowed: whole numbers up to 100",
        )
        for number in (
            *("1e9", "-1k", "+5", "0x10", " 5", "5 ", "5.0", "inf", "nan", "", "-2", "٣", "9" * 30),
        )
    },
}


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_robots_are_refused_in_one_line(name: str) -> None:
    xml, said = HOSTILE[name]
    with pytest.raises(InputError, match="^robot XML: ") as caught:
        robot.load(xml)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 1200


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (model("").encode("utf-16"), "'utf-8' codec can't"),
        (b'<?xml version="1.0" encoding="utf-16"?>' + model("").encode("utf-16-le"), "not well-f"),
        (b'<mujoco model="\xe9"/>', "'utf-8' codec can't"),
    ],
)
def test_other_encodings_are_refused(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "own.xml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"^robot.source: own.xml: not valid MJCF: {said}"):
        mjcf.read(path, tmp_path)


def test_whatever_a_file_declares_it_is_utf_8(tmp_path: Path) -> None:
    text = '<?xml version="1.0" encoding="latin-1"?><!-- a -->' + model("<!-- <x> -->").replace(
        "<mujoco>", '<mujoco model="Käfer &lt;&amp;&quot;">'
    )
    path = tmp_path / "own.xml"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert mjcf.read(path, tmp_path).modelname == 'Käfer <&"'


def test_every_robot_of_gymnasium_is_accepted() -> None:
    for path in robot.GYMNASIUM_ASSETS.glob("*.xml"):
        if path.stem in robot.GYMNASIUM_ROBOTS:
            robot.load(path.read_text(encoding="utf-8"))


def test_messages_name_the_line_of_the_text() -> None:
    text = '<?xml version="1.0"?>\n<!-- a\ncomment -->\n<mujoco>\n<worldbody>\n\n<geom\nsize="1"/>'
    with pytest.raises(InputError, match="unrecognized attribute: 'sise' Element 'geom', line 9$"):
        mjcf.parse(text + '\n<geom sise="1"/></worldbody></mujoco>')


def test_a_robot_may_include_its_neighbours_alone(tmp_path: Path) -> None:
    folder = tmp_path / "robots"
    included = '<include file="parts/leg.xml"/>'
    write_text(folder / "own.xml", f"<mujoco><worldbody>{included}</worldbody></mujoco>")
    write_text(folder / "parts" / "leg.xml", LEG.format(name="leg", inside=""))
    assert [body.name for body in mjcf.read(folder / "own.xml", folder).bodies] == ["world", "leg"]
    write_text(tmp_path / "outside.xml", LEG.format(name="a", inside=""))
    (folder / "parts" / "link.xml").symlink_to(tmp_path / "outside.xml")
    for place in ("../../outside.xml", "/etc/passwd", "parts/link.xml", "link.xml", "../parts/x"):
        write_text(
            folder / "parts" / "leg.xml",
            LEG.format(name="leg", inside=f'<include file="{place}"/>'),
        )
        with pytest.raises(InputError, match=r"given the file .*, allowed: those|No such file"):
            mjcf.read(folder / "own.xml", folder)
    (folder / "parts" / "leg.xml").unlink()
    with pytest.raises(InputError, match=r"leg.xml: No such file"):
        mjcf.read(folder / "own.xml", folder)


def test_included_files_are_found_as_mujoco_finds_them(tmp_path: Path) -> None:
    """First beside the robot's own file, then beside the file that includes them."""
    part = '<include file="part.xml"/>'
    write_text(tmp_path / "own.xml", many('<include file="parts/leg.xml"/>'))
    write_text(tmp_path / "parts" / "leg.xml", LEG.format(name="leg", inside=part))
    write_text(tmp_path / "parts" / "part.xml", LEG.format(name="beside", inside=""))
    names = [[body.name for body in mjcf.read(tmp_path / "own.xml", tmp_path).bodies]]
    write_text(tmp_path / "part.xml", LEG.format(name="first", inside=""))
    names += [[body.name for body in mjcf.read(tmp_path / "own.xml", tmp_path).bodies]]
    assert names == [["world", "leg", "beside"], ["world", "leg", "first"]]


def _write(path: Path, text: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<include file="own.xml"/>', "own.xml: given a file twice, or more files, allowed: 50"),
        ('<include file="leg.xml"/><include file="leg.xml"/>', "leg.xml: given a file twice"),
        ('<include file=""/>', "Is a directory"),
        (f'<include file="{"a" * 5000}"/>', "File name too long"),
        ('<include file="leg.xml"><body/></include>', "an include with elements inside"),
        ('<include file="urdf.xml"/>', "urdf.xml: given <robot>, allowed"),
        ('<include file="half.xml"/>', "half.xml: not valid MJCF: no element found"),
        ('<include file="nested.xml"/>', "more than 1,000 elements"),
        ('<include file="chain/0.xml"/>', "more files, allowed: 50, each once"),
        ('<include file="loop.xml"/>', "loop.xml: "),
    ],
)
def test_hostile_includes_are_refused(tmp_path: Path, inside: str, said: str) -> None:
    _write(tmp_path / "own.xml", many(inside))
    _write(tmp_path / "leg.xml", LEG.format(name="leg", inside=""))
    _write(tmp_path / "urdf.xml", "<robot/>")
    _write(tmp_path / "half.xml", "<mujocoinclude>")
    copies = '<replicate count="40"><include file="leaf.xml"/></replicate>'
    _write(tmp_path / "nested.xml", f"<mujocoinclude>{copies}</mujocoinclude>")
    _write(tmp_path / "leaf.xml", f"<mujocoinclude>{'<body/>' * 40}</mujocoinclude>")
    for number in range(60):
        _write(
            tmp_path / "chain" / f"{number}.xml",
            f'<mujocoinclude><include file="{number + 1}.xml"/></mujocoinclude>',
        )
    (tmp_path / "loop.xml").symlink_to("loop.xml")
    with pytest.raises(InputError, match=f"^robot.source: .*{re.escape(said)}"):
        mjcf.read(tmp_path / "own.xml", tmp_path)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (os.mkfifo, "Not a regular file"),
        (Path.mkdir, "Is a directory"),
        (lambda path: path.symlink_to("/dev/zero"), "given the file '/dev/zero', allowed: those"),
        (
            lambda path: path.symlink_to("/etc/passwd"),
            "given the file '/etc/passwd', allowed: those in robots/",
        ),
    ],
)
def test_only_regular_files_are_read(
    tmp_path: Path, make: Callable[[Path], object], said: str
) -> None:
    own = tmp_path / "robots" / "own.xml"
    write_text(own, many('<include file="part.xml"/>'))
    make(own.with_name("part.xml"))
    with pytest.raises(InputError, match=f"^robot.source: part.xml: {said}"):
        mjcf.read(own, own.parent)
    with pytest.raises(InputError, match=f"^robot.source: part.xml: {said}"):
        mjcf.read(own.with_name("part.xml"), own.parent)
    built = tmp_path / "assets" / "edited.xml"
    built.parent.mkdir()
    make(built)
    with pytest.raises(InputError):
        robot.load(robot.read(tmp_path))


def test_what_may_not_be_read_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "own.xml"
    path.touch(mode=0o000)
    user = os.geteuid()
    os.seteuid(user or 65534)  # root may read everything
    try:
        with pytest.raises(InputError, match=r"^robot.source: own.xml: Permission denied$"):
            mjcf.read(path, tmp_path)
    finally:
        os.seteuid(user)

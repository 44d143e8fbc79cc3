"""MJCF of someone else: it names no file beyond the project's robots, and asks for no memory.

Hostile robots are kept here as data, each with its message.
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


def world(inside: str, before: str = "") -> str:
    return f"<mujoco>{before}<worldbody>{inside}</worldbody></mujoco>"


# The entity's text ends the DOCTYPE for MuJoCo's own parser, which takes the next element as the
# root and the true one as a comment.
TWO_ROOTS = (
    "<!DOCTYPE mujoco [<!ENTITY e '><mujoco><size memory=\"100G\"/><worldbody/></mujoco><!-- '>]>"
    "<mujoco><worldbody/></mujoco><!-- -->"
)
CUBE = '<texture name="{}" builtin="flat" type="cube" width="1800" height="1"/>'
BALLS = '<body><joint type="ball"/><geom size="1"/></body>'
HOSTILE = [
    (model('<include file="/etc/passwd"/>'), "an include of '/etc/passwd', allowed: none"),
    (model('<INCLUDE file="/etc/passwd"/>'), "<INCLUDE file='/etc/passwd'>, allowed: parts withou"),
    (model('<a:include xmlns:a="b" file="/etc/passwd"/>'), "<a:include file='/etc/passwd'>, allow"),
    (asset('<mesh file="a.obj"/>'), "<mesh file='a.obj'>, allowed: parts without files"),
    (asset('<texture file="/dev/zero"/>'), "<texture file='/dev/zero'>, allowed: parts without"),
    *(
        (asset(f'<texture name="a" type="cube" file{side}="/a.png"/>'), f"<texture file{side}='/a")
        for side in ("right", "left", "up", "down", "front", "back")
    ),
    (asset('<model file="/etc/passwd"/>'), "<model file='/etc/passwd'>, allowed: parts without"),
    (asset('<hfield name="a" nrow="9" ncol="9"/>'), "<hfield>, allowed: the elements"),
    (asset('<mesh builtin="sphere" params="9"/>'), "<mesh>, allowed: the elements"),
    (world('<flexcomp count="999 999 9"/>'), "<flexcomp>, allowed: the elements"),
    (world('<attach model="a" body="b" prefix="c"/>'), "<attach>, allowed: the elements"),
    (model('<extension><plugin plugin="a"/></extension>'), "<extension>, allowed: the elements"),
    (model('<compiler><lengthrange inttotal="1e9"/></compiler>'), "<lengthrange>, allowed: the el"),
    (model('<actuator><general gaintype="muscle"/></actuator>'), "allowed: actuators without musc"),
    ('<robot name="a"><link name="b"/></robot>', "<robot>, allowed: the elements"),
    ("<mujocoinclude/>", "the root <mujocoinclude>, allowed: mujoco"),
    (TWO_ROOTS, "a <!DOCTYPE>, allowed: elements and comments"),
    ("<!DOCTYPE a SYSTEM 'file:///etc/passwd'><mujoco/>", "a <!DOCTYPE>, allowed: elements"),
    (model("<![CDATA[<size memory='100G'/>]]>"), "a <![CDATA[ ]]>, allowed: elements"),
    (model("<?php a?>"), "<?php?>, allowed: elements and comments"),
    (model('<size nkey="1" nkey="9"/>'), "duplicate attribute: line 1"),
    (model('<default class="a&#10;b"/>'), "class='a\\nb'>, allowed: text of one line"),
    ("<mujoco/>\x00", "not valid MJCF: not well-formed"),
    ('<mujoco model="\ud800"/>', "not valid MJCF: 'utf-8' codec can't"),
    ("", "not valid MJCF: no element found"),
    ("<mujoco>", "not valid MJCF: no element found"),
    ("<mujoco>" + " " * 2**20 + "</mujoco>", "a file of more than 1,048,576 bytes"),
    (world("<body>" * 80_000 + "</body>" * 80_000), "elements nested more than 50 deep"),
    (world("<body/>" * 140_000), "more than 1,000 elements, each counted as often"),
    (world('<replicate count="100">' * 2 + "<body/>" + "</replicate>" * 2), "than 1,000 elements"),
    (asset("".join(map(CUBE.format, "abcdefghi"))), "174,960,000 pixels of texture, allowed: 16,"),
    (
        model(
            '<default><texture type="cube" builtin="flat" width="8192" height="9"/></default>'
        ).replace("<worldbody/>", '<asset><texture name="a"/></asset><worldbody/>'),
        "given 402,653,184 pixels of texture, allowed: 16,777,216",
    ),
    (
        world(f'<body><freejoint/><geom size="1"/>{BALLS * 30}</body>', '<size memory="1k"/>'),
        "mj_stackAlloc: out of memory",
    ),
    (
        world(
            '<geom type="plane" size="1 1 1"/><body><freejoint/><geom size="1"/>'
            f"{BALLS * 50}</body>",
            '<size memory="2M"/>',
        ),
        "cannot be simulated: mj_stackAlloc: out of memory",
    ),
    (world('<body><freejoint/><geom size="1"/></body>' * 330), "bytes in memory, allowed: 268,43"),
    (model('<size memory="100G"/>'), "memory='100G'>, allowed: whole numbers up to 134"),
    (asset('<texture width="100000"/>'), "width='100000'>, allowed: whole numbers up to 8,192"),
    *(
        (model(f'<size {name}="2000000000"/>'), f"<size {name}='2000000000'>, allowed: whole num")
        for name in ("njmax", "nconmax", "nstack", "nkey", "nuserdata", "nuser_body", "nuser_geom")
    ),
    *(
        (model(f'<size nkey="{size}"/>'), f"<size nkey={size!r}>, allowed: whole numbers up to")
        for size in ("1e9", "-1k", "+5", "0x10", " 5", "5 ", "5.0", "inf", "", "-2", "٣", "9" * 30)
    ),
]


@pytest.mark.parametrize(("xml", "message"), HOSTILE, ids=[message for _, message in HOSTILE])
def test_hostile_robots_are_refused_in_one_line(xml: str, message: str) -> None:
    with pytest.raises(InputError, match="^robot XML: ") as caught:
        robot.load(xml)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 1200


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (model("").encode("utf-16"), "'utf-8' codec can't"),
        (b'<?xml version="1.0" encoding="utf-16"?>' + model("").encode("utf-16-le"), "not well-f"),
        (b'<mujoco model="\xe9"/>', "'utf-8' codec can't"),
    ],
)
def test_other_encodings_are_refused(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "own.xml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"^robot.source: own.xml: not valid MJCF: {message}"):
        mjcf.read(path, tmp_path)


def test_whatever_a_file_declares_it_is_utf_8(tmp_path: Path) -> None:
    text = '<?xml version="1.0" encoding="latin-1"?><!-- a -->' + model("<!-- <x> -->").replace(
        "<mujoco>", '<mujoco model="Käfer &lt;&amp;&quot;">'
    )
    path = tmp_path / "own.xml"
    path.write_bytes(b"\xef\xbb\xbf" + text.encode())
    assert mjcf.read(path, tmp_path).modelname == 'Käfer <&"'


def test_messages_name_the_line_of_the_text() -> None:
    text = '<?xml version="1.0"?>\n<!-- a\ncomment -->\n<mujoco>\n<worldbody>\n\n<geom\nsize="1"/>'
    with pytest.raises(InputError, match="unrecognized attribute: 'sise' Element 'geom', line 9$"):
        mjcf.parse(text + '\n<geom sise="1"/></worldbody></mujoco>')


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ("../../outside.xml", "given the file .*outside.xml', allowed: those in robots/"),
        ("/etc/passwd", "given the file '/etc/passwd', allowed: those in robots/"),
        ("link.xml", "given the file .*outside.xml', allowed: those in robots/"),
        ("../parts/x", "x: No such file"),
    ],
)
def test_a_robot_may_include_its_neighbours_alone(tmp_path: Path, place: str, message: str) -> None:
    parts = tmp_path / "robots" / "parts"
    write_text(parts.with_name("own.xml"), world('<include file="parts/leg.xml"/>'))
    write_text(tmp_path / "outside.xml", LEG.format(name="a", inside=""))
    write_text(parts / "leg.xml", LEG.format(name="leg", inside=f'<include file="{place}"/>'))
    (parts / "link.xml").symlink_to(tmp_path / "outside.xml")
    with pytest.raises(InputError, match=message):
        mjcf.read(parts.with_name("own.xml"), parts.parent)


def test_included_files_are_found_as_mujoco_finds_them(tmp_path: Path) -> None:
    """First beside the robot's own file, then beside the file that includes them."""
    part = '<include file="part.xml"/>'
    write_text(tmp_path / "own.xml", world('<include file="parts/leg.xml"/>'))
    write_text(tmp_path / "parts" / "leg.xml", LEG.format(name="leg", inside=part))
    write_text(tmp_path / "parts" / "part.xml", LEG.format(name="beside", inside=""))
    names = [[body.name for body in mjcf.read(tmp_path / "own.xml", tmp_path).bodies]]
    write_text(tmp_path / "part.xml", LEG.format(name="first", inside=""))
    names += [[body.name for body in mjcf.read(tmp_path / "own.xml", tmp_path).bodies]]
    assert names == [["world", "leg", "beside"], ["world", "leg", "first"]]


@pytest.mark.parametrize(
    ("inside", "message"),
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
def test_hostile_includes_are_refused(tmp_path: Path, inside: str, message: str) -> None:
    write_text(tmp_path / "own.xml", world(inside))
    write_text(tmp_path / "leg.xml", LEG.format(name="leg", inside=""))
    write_text(tmp_path / "urdf.xml", "<robot/>")
    write_text(tmp_path / "half.xml", "<mujocoinclude>")
    copies = '<replicate count="40"><include file="leaf.xml"/></replicate>'
    write_text(tmp_path / "nested.xml", f"<mujocoinclude>{copies}</mujocoinclude>")
    write_text(tmp_path / "leaf.xml", f"<mujocoinclude>{'<body/>' * 40}</mujocoinclude>")
    for number in range(60):
        write_text(
            tmp_path / "chain" / f"{number}.xml",
            f'<mujocoinclude><include file="{number + 1}.xml"/></mujocoinclude>',
        )
    (tmp_path / "loop.xml").symlink_to("loop.xml")
    with pytest.raises(InputError, match=f"^robot.source: .*{re.escape(message)}"):
        mjcf.read(tmp_path / "own.xml", tmp_path)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (os.mkfifo, "Not a regular file"),
        (Path.mkdir, "Is a directory"),
        (lambda path: path.symlink_to("/dev/zero"), "given the file '/dev/zero', allowed: those"),
    ],
)
def test_only_regular_files_are_read(
    tmp_path: Path, make: Callable[[Path], object], message: str
) -> None:
    source = tmp_path / "robots" / "own.xml"
    write_text(source, world('<include file="part.xml"/>'))
    make(source.with_name("part.xml"))
    with pytest.raises(InputError, match=f"^robot.source: part.xml: {message}"):
        mjcf.read(source, source.parent)
    with pytest.raises(InputError, match=f"^robot.source: part.xml: {message}"):
        mjcf.read(source.with_name("part.xml"), source.parent)
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

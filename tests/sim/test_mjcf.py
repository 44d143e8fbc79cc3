"""MJCF of someone else: it names no file beyond the project's robots, and asks for no memory."""

from pathlib import Path

import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.sim import mjcf, robot

LEG = '<mujocoinclude><body name="{name}"><geom size="0.1"/>{inside}</body></mujocoinclude>'


def model(inside: str) -> str:
    return f"<mujoco>{inside}<worldbody/></mujoco>"


@pytest.mark.parametrize(
    ("xml", "line"),
    [
        (
            model('<include file="/etc/passwd"/>'),
            "given an include of '/etc/passwd', allowed: none",
        ),
        (model('<asset><mesh file="a.obj"/></asset>'), "given <mesh file='a.obj'>, allowed: parts"),
        (model('<asset><texture file="/dev/zero"/></asset>'), "given <texture file='/dev/zero'>"),
        (model('<size memory="100G"/>'), "given memory='100G', allowed: at most 1,073,741,824"),
        (model('<size njmax="1e9"/>'), "given njmax='1e9', allowed: at most 1,000,000"),
        (
            model('<asset><texture width="100000" height="9"/></asset>'),
            "given width='100000', allowed: at most 8,192",
        ),
        (
            model('<replicate count="100"><replicate count="100"><b/></replicate></replicate>'),
            "given 10,000 copies, allowed: 1,000",
        ),
        ("<mujoco>" + " " * 2**20 + "</mujoco>", "given a file of more than 1,048,576 bytes"),
        ("<mujoco>", "not valid MJCF: no element found"),
        ("\x00", "not valid MJCF"),
    ],
)
def test_what_no_robot_needs_is_refused(xml: str, line: str) -> None:
    with pytest.raises(InputError, match="^robot XML: ") as caught:
        mjcf.check(xml)
    assert line in str(caught.value) and "\n" not in str(caught.value)
    with pytest.raises(InputError):
        robot.load(xml)


def test_every_robot_of_gymnasium_is_accepted() -> None:
    for path in robot.GYMNASIUM_ASSETS.glob("*.xml"):
        if path.stem in robot.GYMNASIUM_ROBOTS:
            mjcf.check(path.read_text(encoding="utf-8"))


def test_a_robot_may_include_its_neighbours_alone(tmp_path: Path) -> None:
    folder = tmp_path / "robots"
    included = '<include file="parts/leg.xml"/>'
    write_text(folder / "own.xml", f"<mujoco><worldbody>{included}</worldbody></mujoco>")
    write_text(folder / "parts" / "leg.xml", LEG.format(name="leg", inside=""))
    mjcf.check_file(folder / "own.xml", folder)
    for place in ("../../outside.xml", "/etc/passwd"):
        write_text(
            folder / "parts" / "leg.xml",
            LEG.format(name="leg", inside=f'<include file="{place}"/>'),
        )
        with pytest.raises(InputError, match=r"leg.xml: given an include of .*, allowed: files in"):
            mjcf.check_file(folder / "own.xml", folder)
    (folder / "parts" / "leg.xml").unlink()
    with pytest.raises(InputError, match=r"leg.xml: No such file"):
        mjcf.check_file(folder / "own.xml", folder)

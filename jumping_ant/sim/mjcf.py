"""Checks of MJCF that someone else may have written, before MuJoCo reads it.

MuJoCo opens any file that MJCF names, and reserves any memory that it asks for.
"""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

from jumping_ant.base.errors import InputError

MOST_BYTES = 2**20  # of a file; Gymnasium's largest robot has 12 kB
LARGEST = {  # the largest value of an attribute, wherever it stands
    "height": 8192,
    "memory": 2**30,
    "nconmax": 10**6,
    "ncol": 2048,
    "njmax": 10**6,
    "nrow": 2048,
    "nstack": 2**30,
    "nuserdata": 10**6,
    "width": 8192,
}
MOST_COPIES = 1000  # of what an element repeats, nested ones multiplied
_UNITS = {"k": 2**10, "m": 2**20, "g": 2**30, "t": 2**40, "p": 2**50, "e": 2**60}


def check_file(path: Path, folder: Path) -> None:
    """Check a file, and those it includes.

    Args:
        path: The file.
        folder: The folder that included files must be in.

    Raises:
        InputError: It is too large, not XML, includes a file of another folder, names any other
            file, or has sizes that no robot needs.
    """
    seen: set[Path] = set()
    waiting = [path]
    while waiting:
        path = waiting.pop()
        seen.add(path)
        try:
            with path.open("rb") as file:
                content = file.read(MOST_BYTES + 1)
        except OSError as error:
            raise InputError(f"robot.source: {path}: {error.strerror}") from error
        for name in _included(content, f"robot.source: {path.name}"):
            included = (path.parent / name).resolve()
            if not included.is_relative_to(folder.resolve()):
                raise InputError(
                    f"robot.source: {path.name}: given an include of {name!r}, allowed: files in "
                    f"{folder.name}/"
                )
            if included not in seen:
                waiting.append(included)


def check(xml: str) -> None:
    """Check a robot as text.

    Raises:
        InputError: It is too large, not XML, names a file, or has sizes that no robot needs.
    """
    if names := _included(xml.encode(), "robot XML"):
        raise InputError(f"robot XML: given an include of {names[0]!r}, allowed: none")


def _included(content: bytes, where: str) -> list[str]:
    """Check one file's content, and return the names of the files that it includes."""
    if len(content) > MOST_BYTES:
        raise InputError(f"{where}: given a file of more than {MOST_BYTES:,} bytes")
    try:
        root = ET.fromstring(content)
    except (ET.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{where}: not valid MJCF: {error}") from error
    names = []
    waiting: list[tuple[ET.Element, float]] = [(root, 1)]
    while waiting:
        element, copies = waiting.pop()
        if "file" in element.attrib:
            if element.tag != "include":
                raise InputError(
                    f"{where}: given <{element.tag} file={element.attrib['file']!r}>, allowed: "
                    "parts without files, such as capsules and boxes"
                )
            names.append(element.attrib["file"])
        for name, limit in LARGEST.items():
            if _size(element.get(name, "0")) > limit:
                raise InputError(
                    f"{where}: given {name}={element.attrib[name]!r}, allowed: at most {limit:,}"
                )
        copies *= math.prod(max(1, _size(number)) for number in element.get("count", "").split())
        if copies > MOST_COPIES:
            raise InputError(f"{where}: given {copies:,.0f} copies, allowed: {MOST_COPIES:,}")
        waiting += [(child, copies) for child in element]
    return names


def _size(text: str) -> float:
    """Return a size such as 5 or 5M as a number; 0 if it is none, which MuJoCo refuses."""
    text = text.strip().lower()
    unit = _UNITS.get(text[-1:], 1)
    try:
        return float(text[:-1] if unit > 1 else text) * unit
    except ValueError:
        return 0.0

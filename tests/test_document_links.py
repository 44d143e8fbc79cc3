"""Links in the documents lead to files of the repository, and to headings that are there."""

import re
from pathlib import Path

import pytest

from jumping_ant.base.files import PROJECT_ROOT
from scripts import checkout

LINK = re.compile(r"\]\((?!\w+:)([^)\s#]*)#?([^)\s]*)\)")  # but addresses
HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)
CODE = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)
FILES = checkout.project_files()


def _anchors(text: str) -> set[str]:
    """Return the anchors that GitHub gives the headings of a document."""
    headings = HEADING.findall(CODE.sub("", text))
    return {re.sub(r"[^\w\- ]", "", heading).lower().replace(" ", "-") for heading in headings}


def _broken(document: Path, files: set[Path]) -> list[str]:
    """Return the links of a document that lead nowhere."""
    broken = []
    for link, anchor in LINK.findall(CODE.sub("", document.read_text(encoding="utf-8"))):
        target = (document.parent / link).resolve() if link else document
        is_there = any(path == target or target in path.parents for path in files)
        if not is_there or (anchor and anchor not in _anchors(target.read_text(encoding="utf-8"))):
            broken.append(f"{link}#{anchor}" if anchor else link)
    return broken


@pytest.mark.parametrize("document", [name for name in FILES if name.endswith(".md")])
def test_links_lead_somewhere(document: str) -> None:
    files = {PROJECT_ROOT / name for name in FILES}
    assert not _broken(PROJECT_ROOT / document, files)


def test_broken_links_are_found(tmp_path: Path) -> None:
    other, document = tmp_path / "other.md", tmp_path / "document.md"
    other.write_text("# One, two: *three*\n```\n# no heading\n```\n")
    document.write_text(
        "## Here\n[a](other.md) [b](other.md#one-two-three) [c](#here) [d](https://x.org#y)\n"
        "[e](other.md#no-heading) [f](none.md) [g](#there)\n"
    )
    found = _broken(document, {other, document})
    assert found == ["other.md#no-heading", "none.md", "#there"]

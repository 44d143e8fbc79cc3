"""Results in the documents."""

from pathlib import Path

import pytest

from jumping_ant.base.errors import InputError
from scripts import publish

CLAIM = {"text": "A leads", "verdict": "refuted", "p_holm": 0.01234, "evidence": "Much (8 seeds)."}
TEXT = "Above.\n\n<!-- part -->\nold\nlines\n<!-- end of part -->\n\nBelow.\n"


def test_a_section_is_replaced_between_its_marks(tmp_path: Path) -> None:
    path = tmp_path / "results.md"
    path.write_text(TEXT)
    publish.replace_section(path, "part", "new\n")
    assert path.read_text() == TEXT.replace("old\nlines", "new")


@pytest.mark.parametrize("mark", ["<!-- part -->", "<!-- end of part -->"])
def test_a_document_that_lacks_a_mark_is_left_alone(tmp_path: Path, mark: str) -> None:
    path = tmp_path / "results.md"
    path.write_text(TEXT.replace(mark, "<!-- another -->"))
    before = path.read_text()
    with pytest.raises(InputError, match="results.md: given no <!-- part --> ... <!-- end of part"):
        publish.replace_section(path, "part", "new\n")
    assert path.read_text() == before


@pytest.mark.parametrize(
    ("name", "document"),
    [
        ("claims", "README.md"),
        ("printed", "docs/article.md"),
        *((preset, "docs/results.md") for preset in publish.FOLDERS),
    ],
)
def test_the_documents_have_their_marks(name: str, document: str) -> None:
    text = (publish.PROJECT_ROOT / document).read_text()
    assert text.index(f"<!-- {name} -->\n") < text.index(f"<!-- end of {name} -->")


def test_claims_are_a_table_with_or_without_evidence() -> None:
    assert publish.claim_table([CLAIM], with_evidence=False).splitlines() == [
        "| claim | verdict | p after Holm |",
        "| --- | --- | --- |",
        "| A leads | refuted | 0.012 |",
    ]
    last = publish.claim_table([CLAIM], with_evidence=True).splitlines()[-1]
    assert last == "| A leads | refuted | 0.012 | Much (8 seeds). |"

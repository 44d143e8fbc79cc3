"""Write the results of the working tree into the documents.

Usage: python -m scripts.publish [PRESET]

The results are of the preset's run in .presets/ (`make preset`) or, for `default`, of this folder;
`tuning` takes those in results/tuning/. Some comparisons are copied into results/ first, and their
figures into docs/images/.
"""

from pathlib import Path
from typing import Any

from jumping_ant.base import command_line
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, read_json, write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.comparison.results import merged
from jumping_ant.params import claims as rows
from jumping_ant.tracking import descriptions
from scripts import animation, markdown
from scripts.preset import folder_of

DOCS, RESULTS = PROJECT_ROOT / "docs", PROJECT_ROOT / "results"
README, TABLES = PROJECT_ROOT / "README.md", DOCS / "tables.md"
COMPARISONS = {name: RESULTS / f"{name}.json" for name in ("families", "thesis")}  # in git
FINALS = DOCS / "published" / "ant_v4.csv"
SECTIONS = [
    *("default", "ablations", "article", "run", "hopper", "families", "thesis"),
    "tuning",  # is no preset
]
WITHOUT_CLAIMS = ("run", "hopper")  # the article makes none for these tasks
FIGURES = {  # of results/figures/, for docs/images/
    "default": ("learning_curves", "final_return"),
    "families": ("learning_curves", "final_return"),
    "thesis": ("final_return",),
}
Sections = dict[tuple[Path, str], str]  # what documents say, by document and mark


def main() -> None:
    """Parse the command line and write."""
    parser = command_line.parser(__doc__)
    parser.add_argument("preset", nargs="?", default="default", choices=SECTIONS)
    preset = parser.parse_args().preset
    folder = _folder(preset)
    if preset in COMPARISONS:
        write_json(COMPARISONS[preset], results(folder))
    for (document, name), content in sections(preset).items():
        replace_section(document, name, content)
    prefix = "" if preset == "default" else f"{preset}-"
    for name in FIGURES.get(preset, ()):
        picture = (folder / "results" / "figures" / f"{name}.png").read_bytes()
        write_bytes(DOCS / "images" / f"{prefix}{name}.png", picture)
    if preset == "default":
        write_bytes(DOCS / "images" / "jumping.webp", animation.picture())


def results(root: Path) -> dict[str, Any]:
    """Return the comparison in a project's folder, with what it took in seconds."""
    paths = Paths(root)
    return merged(_read(paths.comparison), _read(paths.speed))


def sections(preset: str) -> Sections:
    """Return what documents say of a preset that has been run."""
    if preset == "tuning":
        searches = [_read(path) for path in sorted((RESULTS / "tuning").glob("*.json"))]
        return {(TABLES, preset): markdown.tuning_table(searches)}
    compared = _read(COMPARISONS[preset]) if preset in COMPARISONS else results(_folder(preset))
    agents = "\n".join(descriptions.agent_table(compared["agents"]))
    claims = markdown.claim_table(compared["claims"])
    if preset == "default":
        kept = markdown.kept_table(_read(Paths().robustness))
        return {
            (README, "ranking"): agents,
            (DOCS / "results.md", preset): claims,
            (TABLES, "robustness"): kept,
        }
    found = {(TABLES, preset): agents if preset in WITHOUT_CLAIMS else f"{agents}\n{claims}"}
    if preset == "article":
        found |= printed()
    if preset == "run":
        found |= {(TABLES, "published"): markdown.published_table(_folder(preset))} | finals()
    return found


def printed() -> Sections:
    """Return the article's printed values beside ours, from results/article.json."""
    found = _read(RESULTS / "article.json")
    document = DOCS / "article.md"
    return {
        (document, "printed"): markdown.printed_table(found["printed"]),
        (document, "traces"): markdown.traces_table(found["printed"]),
        (document, "hours"): markdown.hours_table(found["training"]),
    }


def finals() -> Sections:
    """Return published returns on Ant-v4."""
    return {(TABLES, "finals"): markdown.finals_table(FINALS)}


def asked() -> Sections:
    """Return the default's claims."""
    own = rows.read(PROJECT_ROOT / "claims" / "default.yaml")
    return {(DOCS / "measures-and-claims.md", "claims"): markdown.asked_table(own)}


def committed_sections() -> Sections:
    """Return what documents say of results that are in git."""
    found = printed() | finals() | asked()
    for preset in ("default", *COMPARISONS, "tuning"):
        found |= sections(preset)
    return found


def _folder(preset: str) -> Path:
    return PROJECT_ROOT if preset == "default" else folder_of(preset)


def _read(path: Path) -> Any:
    return read_json(path, "report")


def replace_section(document: Path, name: str, content: str) -> None:
    """Replace what a document says between the marks of a name.

    Raises:
        InputError: The document lacks a mark.
    """
    text = document.read_text(encoding="utf-8")
    write_text(document, markdown.replaced(document, text, name, content))


if __name__ == "__main__":
    with reported():
        main()

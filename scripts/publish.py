"""Write the results of the working tree into the documents.

Usage: python -m scripts.publish [PRESET]

`SECTIONS` says what is written for each preset, from its run in .presets/ (`make preset`) or, for
`default`, in this folder. `tuning` is what results/tuning/ says of the searches for settings. For
some presets the comparison is copied into results/ first, and its figures into docs/images/.
"""

from collections import ChainMap
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jumping_ant.base import command_line
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, read_json, write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.comparison.results import merged
from jumping_ant.tracking import descriptions
from scripts import animation, markdown
from scripts.preset import folder_of

DOCS = PROJECT_ROOT / "docs"
README = PROJECT_ROOT / "README.md"
RESULTS = PROJECT_ROOT / "results"
RESULTS_PAGE = DOCS / "results.md"
TABLES = DOCS / "tables.md"
COMPARISONS = {name: RESULTS / f"{name}.json" for name in ("families", "thesis")}  # in git
REPLICATION = RESULTS / "replicate.json"
FINALS = DOCS / "published" / "ant_v4.csv"
CURVES_AND_RETURNS = ("learning_curves", "final_return")
FIGURES = {  # of results/figures/, for docs/images/
    "default": CURVES_AND_RETURNS,
    "families": CURVES_AND_RETURNS,
    "thesis": ("final_return",),
}
Sections = dict[tuple[Path, str], str]  # what documents say, by document and mark


def main() -> None:
    """Parse the command line and write."""
    parser = command_line.parser(__doc__)
    parser.add_argument("preset", nargs="?", default="default", choices=SECTIONS)
    preset = parser.parse_args().preset
    folder = _folder(preset)
    if preset == "replicate":
        write_json(REPLICATION, everything(folder))
    elif preset in COMPARISONS:
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


def everything(root: Path) -> dict[str, Any]:
    """Return what `results` does, with the claims on robustness beside the others."""
    return results(root) | {"robustness": _read(Paths(root).robustness)["claims"]}


def sections(preset: str) -> Sections:
    """Return what documents say of a preset that has been run."""
    return dict(ChainMap(*(write(preset) for write in SECTIONS[preset])))


def committed_sections() -> Sections:
    """Return what documents say of results that are in git."""
    presets = ("default", *COMPARISONS, "replicate", "tuning")
    return dict(ChainMap(printed("article"), finals("run"), *map(sections, presets)))


def comparison(preset: str) -> Sections:
    """Return the ranking of a preset's agents, and its claims."""
    verdicts = markdown.claim_table(_compared(preset)["claims"])
    return {place: f"{agents}\n{verdicts}" for place, agents in ranking(preset).items()}


def ranking(preset: str) -> Sections:
    """Return the ranking of a preset's agents."""
    agents = "\n".join(descriptions.agent_table(_compared(preset)["agents"]))
    return {(README, "ranking") if preset == "default" else (TABLES, preset): agents}


def claims(preset: str) -> Sections:
    """Return the verdicts on the default's claims."""
    return {(RESULTS_PAGE, preset): markdown.claim_table(_compared(preset)["claims"])}


def robustness(preset: str) -> Sections:
    """Return what the agents keep of their return under perturbations, and the claims on it."""
    withstood = _read(Paths(_folder(preset)).robustness)
    verdicts = markdown.claim_table(withstood["claims"])
    return {(TABLES, "robustness"): f"{markdown.kept_table(withstood)}\n\n{verdicts}"}


def printed(_: str) -> Sections:
    """Return the article's printed values beside ours, from results/article.json."""
    table = markdown.printed_table(_read(RESULTS / "article.json")["printed"])
    return {(DOCS / "article.md", "printed"): table}


def published(preset: str) -> Sections:
    """Return SAC's returns beside published ones."""
    return {(TABLES, "published"): markdown.published_table(_folder(preset))}


def finals(_: str) -> Sections:
    """Return published returns on Ant-v4."""
    return {(TABLES, "finals"): markdown.finals_table(FINALS)}


def replication(preset: str) -> Sections:
    """Return the verdicts of the default beside those on other seeds."""
    table = markdown.replication_table(everything(PROJECT_ROOT), _read(REPLICATION))
    return {(TABLES, preset): table}


def tuning(preset: str) -> Sections:
    """Return what the searches for settings found."""
    searches = [_read(path) for path in sorted((RESULTS / "tuning").glob("*.json"))]
    return {(TABLES, preset): markdown.tuning_table(searches)}


SECTIONS: dict[str, list[Callable[[str], Sections]]] = {
    "default": [ranking, claims, robustness],
    "ablations": [comparison],
    "article": [comparison, printed],
    "run": [ranking, published, finals],  # the article makes no claims for this task or hopper's
    "hopper": [ranking],
    "families": [comparison],
    "replicate": [replication],
    "thesis": [comparison],
    "tuning": [tuning],
}


def _folder(preset: str) -> Path:
    return PROJECT_ROOT if preset == "default" else folder_of(preset)


def _compared(preset: str) -> dict[str, Any]:
    """Return a preset's comparison: where it is in git, that one."""
    return _read(COMPARISONS[preset]) if preset in COMPARISONS else results(_folder(preset))


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

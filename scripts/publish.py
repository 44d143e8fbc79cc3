"""Write the results of the working tree into the documents.

Usage: python -m scripts.publish [PRESET]

Writes the section of that preset in docs/results.md, from its run in .presets/ (`make preset`).
With the preset `default`, which is the default, it writes the pictures of the README as well:
docs/images/, and README.md's table of claims. With `article` it also writes the table of printed
values in docs/article.md, from results/article.json; `article-runs` is what
results/article_tests.csv says of DQN with other versions and contacts, in the same document. With
`run` it writes SAC's returns beside published ones, too. With `families` and `thesis` the sections
are in docs/families.md, which gets pictures as well, and the comparisons in
results/families.json and results/thesis.json. With `replicate` the verdicts stand beside the
default's, and results/replicate.json has them; `decided` is what results/decided.json says of the
claims that more seeds were added for (`make decide`), in docs/results.md, and `tuning` what
results/tuning/ says of the searches for settings, in docs/tuning.md.
"""

import csv
from pathlib import Path
from typing import Any

from jumping_ant.base import command_line
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, read_json, write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import params_file, summaries
from jumping_ant.tracking import descriptions
from scripts import animation, markdown, marks
from scripts.preset import folder_of

DOCS = PROJECT_ROOT / "docs"
README = PROJECT_ROOT / "README.md"
RESULTS = PROJECT_ROOT / "results"
PRESETS = ("default", "ablations", "article", "run", "hopper", "families", "replicate", "thesis")
OTHERS = ("article-runs", "decided", "tuning")  # no presets
DOCUMENTS = dict.fromkeys(("families", "thesis"), DOCS / "families.md")  # others: docs/results.md
COMPARISONS = {name: RESULTS / f"{name}.json" for name in DOCUMENTS}  # comparisons that are in git
OTHER_TASKS = ("run", "hopper")  # for which the article makes no claims
FINALS = DOCS / "published" / "ant_v4.csv"
CURVES_AND_RETURNS = ("learning_curves", "final_return")
FIGURES = {  # of results/figures/, for docs/images/
    "default": CURVES_AND_RETURNS,
    "families": CURVES_AND_RETURNS,
    "thesis": ("final_return",),
}
TUNING = RESULTS / "tuning"
REPLICATION = RESULTS / "replicate.json"
RESULTS_PAGE = DOCS / "results.md"
Sections = dict[tuple[Path, str], str]  # what documents say, by document and mark


def main() -> None:
    """Parse the command line and write."""
    parser = command_line.parser(__doc__)
    parser.add_argument("preset", nargs="?", default="default", choices=[*PRESETS, *OTHERS])
    preset = parser.parse_args().preset
    folder = PROJECT_ROOT if preset == "default" else folder_of(preset)
    if preset == "replicate":
        write_json(REPLICATION, everything(folder))
    elif preset in COMPARISONS:
        write_json(COMPARISONS[preset], results(folder))
    for (document, name), content in _sections(preset, folder).items():
        replace_section(document, name, content)
    prefix = "" if preset == "default" else f"{preset}-"
    for name in FIGURES.get(preset, ()):
        picture = (folder / "results" / "figures" / f"{name}.png").read_bytes()
        write_bytes(DOCS / "images" / f"{prefix}{name}.png", picture)
    if preset == "default":
        write_bytes(DOCS / "images" / "jumping.webp", animation.picture())


def _sections(preset: str, folder: Path) -> Sections:
    """Return what documents say of a preset that has been run in a folder."""
    if preset == "tuning":
        return tuning_sections()
    if preset == "article-runs":
        return runs_sections()
    if preset == "decided":
        return decided_sections()
    if preset == "replicate":
        return replication_sections()
    if preset in COMPARISONS:
        return stored_sections(preset)
    sections = comparison_sections(preset, results(folder))
    if preset == "default":
        sections |= ceiling_sections() | robustness_sections()
    elif preset == "article":
        sections |= printed_sections()
    elif preset == "run":
        sections[RESULTS_PAGE, "published"] = markdown.published_table(folder)
        sections |= finals_sections()
    return sections


def results(root: Path) -> dict[str, Any]:
    """Return the comparison in a project's folder, with what it took in seconds."""
    paths = Paths(root)
    return summaries.merged(_read(paths.comparison), _read(paths.speed))


def everything(root: Path) -> dict[str, Any]:
    """Return what `results` does, with the claims on robustness beside the others."""
    return results(root) | {"robustness": _read(Paths(root).robustness)["claims"]}


def committed_sections() -> Sections:
    """Return what documents say of results that are in git."""
    return (
        comparison_sections("default", results(PROJECT_ROOT))
        | stored_sections("families")
        | stored_sections("thesis")
        | ceiling_sections()
        | robustness_sections()
        | replication_sections()
        | decided_sections()
        | printed_sections()
        | runs_sections()
        | finals_sections()
        | tuning_sections()
    )


def comparison_sections(preset: str, compared: dict[str, Any]) -> Sections:
    """Return what documents say of a comparison.

    Args:
        preset: The preset that it was run with.
        compared: What `results` returns of it.
    """
    agents = "\n".join(descriptions.agent_table(compared["agents"]))
    evidence = markdown.claim_table(compared["claims"], with_evidence=True)
    parts = [agents] if preset in OTHER_TASKS else [agents, evidence]
    sections = {(DOCUMENTS.get(preset, RESULTS_PAGE), preset): "\n".join(parts)}
    if preset == "default":
        sections[README, "claims"] = markdown.claim_table(compared["claims"], with_evidence=False)
    return sections


def stored_sections(preset: str) -> Sections:
    """Return what documents say of a comparison that is in git."""
    return comparison_sections(preset, _read(COMPARISONS[preset]))


def printed_sections() -> Sections:
    """Return what documents say of the article's printed values."""
    printed = _read(RESULTS / "article.json")["printed"]
    return {(DOCS / "article.md", "printed"): markdown.printed_table(printed)}


def ceiling_sections() -> Sections:
    """Return what documents say of the learners beside plans through the simulator."""
    from scripts import ceiling  # imports the simulator, which takes seconds

    agents, plans = results(PROJECT_ROOT)["agents"], _read(ceiling.PATH)
    return {(RESULTS_PAGE, "ceiling"): ceiling.shares(params_file.load(), agents, plans)}


def robustness_sections() -> Sections:
    """Return what documents say of the agents under perturbations."""
    withstood = _read(Paths(PROJECT_ROOT).robustness)
    claims = markdown.claim_table(withstood["claims"], with_evidence=True)
    return {(RESULTS_PAGE, "robustness"): f"{markdown.kept_table(withstood)}\n\n{claims}"}


def replication_sections() -> Sections:
    """Return what documents say of the claims on other seeds."""
    table = markdown.replication_table(everything(PROJECT_ROOT), _read(REPLICATION))
    return {(RESULTS_PAGE, "replicate"): table}


def decided_sections() -> Sections:
    """Return what documents say of the claims that more seeds were added for."""
    looked_at = [claim for claim in _read(RESULTS / "decided.json")["claims"] if "look" in claim]
    return {(RESULTS_PAGE, "decided"): markdown.claim_table(looked_at, with_evidence=True)}


def runs_sections() -> Sections:
    """Return what documents say of DQN's runs with other versions and contacts."""
    from scripts import article_runs  # imports what trains and tests, which takes seconds

    return {
        (DOCS / "article.md", "runs"): markdown.runs_table(article_runs.summary(article_runs.PATH))
    }


def finals_sections() -> Sections:
    """Return what documents say of published returns on Ant-v4."""
    rows = list(csv.DictReader(FINALS.read_text(encoding="utf-8").splitlines()))
    return {(RESULTS_PAGE, "finals"): markdown.finals_table(rows)}


def tuning_sections() -> Sections:
    """Return what documents say of the searches for settings."""
    found = [_read(path) for path in sorted(TUNING.glob("*.json"))]
    return {(DOCS / "tuning.md", "tuning"): markdown.tuning_table(found)}


def _read(path: Path) -> Any:
    return read_json(path, "report")


def replace_section(path: Path, name: str, content: str) -> None:
    """Replace the text between a document's marks `<!-- name -->` and `<!-- end of name -->`.

    Raises:
        InputError: The document lacks a mark.
    """
    before = path.read_text(encoding="utf-8")
    write_text(path, marks.replaced(path, before, name, content))


def section(path: Path, name: str) -> str:
    """Return the text between a document's marks `<!-- name -->` and `<!-- end of name -->`.

    Raises:
        InputError: The document lacks a mark.
    """
    return marks.between(path, path.read_text(encoding="utf-8"), name)


if __name__ == "__main__":
    with reported():
        main()

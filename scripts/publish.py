"""Write the results of the working tree into the documents.

Usage: python -m scripts.publish [PRESET]

Writes the section of that preset in docs/results.md, from its run in .presets/ (`make preset`).
With the preset `default`, which is the default, it writes the pictures of the README as well:
docs/images/, and README.md's table of claims. With `article` it also writes the table of printed
values in docs/article.md, from results/article.json; `article-runs` is what
results/article_tests.csv says of DQN with other versions and contacts, in the same document. With
`run` it writes SAC's returns beside published ones, too. With `families` the section is in
docs/families.md, which gets pictures as well, and results/families.json the comparison; `tuning` is
what results/tuning/ says of the searches for settings, in docs/tuning.md.
"""

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import imageio.v2 as imageio
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from jumping_ant.agents import catalogue
from jumping_ant.base import command_line, tables
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT, write_bytes, write_json, write_text
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import curves, params_file, summaries
from jumping_ant.looks import wording
from jumping_ant.looks.wording import p_value
from jumping_ant.tracking import descriptions
from scripts.preset import folder_of

DOCS = PROJECT_ROOT / "docs"
README = PROJECT_ROOT / "README.md"
RESULTS = PROJECT_ROOT / "results"
PRESETS = ("default", "ablations", "article", "run", "hopper", "families")
OTHERS = ("article-runs", "tuning")  # no presets
DOCUMENTS = {"families": DOCS / "families.md"}  # others: docs/results.md
OTHER_TASKS = ("run", "hopper")  # for which the article makes no claims
PUBLISHED = DOCS / "published" / "ant_sac.csv"
PUBLISHED_COLUMNS = {"seed": tables.SEED, "env_steps": curves.COUNT, "return": tables.Column()}
PUBLISHED_STEPS = (100_000, 200_000)
FINALS = DOCS / "published" / "ant_v4.csv"
FIGURES = ("learning_curves", "final_return")
VERDICTS = {True: "yes", False: "no", None: "open"}  # whether a printed value is reproduced
PICTURES = {"default": "", "families": "families-"}  # prefixes of their names in docs/images/
TUNING = RESULTS / "tuning"
RESULTS_PAGE = DOCS / "results.md"
SIDE = 300  # [pixels] side of an agent's film in the animation
SECONDS = 6.0  # length of the animation
FPS = 20
START = 7.0  # [s] in the films
FONT = ImageFont.load_default(20)


Sections = dict[tuple[Path, str], str]  # what documents say, by document and mark


def main() -> None:
    """Parse the command line and write."""
    parser = command_line.parser(__doc__)
    parser.add_argument("preset", nargs="?", default="default", choices=[*PRESETS, *OTHERS])
    preset = parser.parse_args().preset
    folder = PROJECT_ROOT if preset == "default" else folder_of(preset)
    for (document, name), content in _sections(preset, folder).items():
        replace_section(document, name, content)
    if preset in PICTURES:
        for name in FIGURES:
            picture = (folder / "results" / "figures" / f"{name}.png").read_bytes()
            write_bytes(DOCS / "images" / f"{PICTURES[preset]}{name}.png", picture)
    if preset == "default":
        write_bytes(DOCS / "images" / "jumping.webp", animation())
    elif preset == "families":
        write_json(RESULTS / "families.json", results(folder))


def _sections(preset: str, folder: Path) -> Sections:
    """Return what documents say of a preset that has been run in a folder."""
    if preset == "tuning":
        return tuning_sections()
    if preset == "article-runs":
        return runs_sections()
    sections = comparison_sections(preset, results(folder))
    if preset == "default":
        sections |= ceiling_sections() | robustness_sections()
    elif preset == "article":
        sections |= printed_sections()
    elif preset == "run":
        sections[RESULTS_PAGE, "published"] = published_table(folder)
        sections |= finals_sections()
    return sections


def results(root: Path) -> dict[str, Any]:
    """Return the comparison in a project's folder, with what it took in seconds."""
    paths = Paths(root)
    return summaries.merged(_read(paths.comparison), _read(paths.speed))


def committed_sections() -> Sections:
    """Return what documents say of results that are in git."""
    return (
        comparison_sections("default", results(PROJECT_ROOT))
        | comparison_sections("families", _read(RESULTS / "families.json"))
        | ceiling_sections()
        | robustness_sections()
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
    evidence = claim_table(compared["claims"], with_evidence=True)
    parts = [agents] if preset in OTHER_TASKS else [agents, evidence]
    sections = {(DOCUMENTS.get(preset, RESULTS_PAGE), preset): "\n".join(parts)}
    if preset == "default":
        sections[README, "claims"] = claim_table(compared["claims"], with_evidence=False)
    return sections


def printed_sections() -> Sections:
    """Return what documents say of the article's printed values."""
    printed = _read(RESULTS / "article.json")["printed"]
    return {(DOCS / "article.md", "printed"): printed_table(printed)}


def ceiling_sections() -> Sections:
    """Return what documents say of the learners beside plans through the simulator."""
    from scripts import ceiling  # imports the simulator, which takes seconds

    agents, plans = results(PROJECT_ROOT)["agents"], _read(ceiling.PATH)
    return {(RESULTS_PAGE, "ceiling"): ceiling.shares(params_file.load(), agents, plans)}


def robustness_sections() -> Sections:
    """Return what documents say of the agents under perturbations."""
    withstood = _read(Paths(PROJECT_ROOT).robustness)
    claims = claim_table(withstood["claims"], with_evidence=True)
    return {(RESULTS_PAGE, "robustness"): f"{kept_table(withstood)}\n\n{claims}"}


def runs_sections() -> Sections:
    """Return what documents say of DQN's runs with other versions and contacts."""
    from scripts import article_runs  # imports what trains and tests, which takes seconds

    return {(DOCS / "article.md", "runs"): runs_table(article_runs.summary(article_runs.PATH))}


def finals_sections() -> Sections:
    """Return what documents say of published returns on Ant-v4."""
    rows = list(csv.DictReader(FINALS.read_text(encoding="utf-8").splitlines()))
    return {(RESULTS_PAGE, "finals"): finals_table(rows)}


def tuning_sections() -> Sections:
    """Return what documents say of the searches for settings."""
    found = [_read(path) for path in sorted(TUNING.glob("*.json"))]
    return {(DOCS / "tuning.md", "tuning"): tuning_table(found)}


def _read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def replace_section(path: Path, name: str, content: str) -> None:
    """Replace the text between a document's marks `<!-- name -->` and `<!-- end of name -->`.

    Raises:
        InputError: The document lacks a mark.
    """
    head, _, tail = _parts(path, name)
    write_text(path, f"{head}{content.rstrip()}{tail}")


def section(path: Path, name: str) -> str:
    """Return the text between a document's marks `<!-- name -->` and `<!-- end of name -->`.

    Raises:
        InputError: The document lacks a mark.
    """
    return _parts(path, name)[1]


def _parts(path: Path, name: str) -> tuple[str, str, str]:
    """Return a document up to a mark and with it, from there to the next, and the rest."""
    begin, end = f"<!-- {name} -->\n", f"\n<!-- end of {name} -->"
    head, found_begin, rest = path.read_text(encoding="utf-8").partition(begin)
    content, found_end, tail = rest.partition(end)
    if not (found_begin and found_end):
        raise InputError(
            f"{path}: given no {begin.strip()} ... {end.strip()}, between which to write"
        )
    return head + begin, content, end + tail


def claim_table(claims: Sequence[dict[str, Any]], with_evidence: bool) -> str:
    """Return the claims, their verdicts and adjusted p values as Markdown."""
    headings = ["claim", "verdict", "adjusted p", *(["evidence"] if with_evidence else [])]
    rows = [
        [claim["text"], claim["verdict"], p_value(summaries.deciding_p(claim)), claim["evidence"]]
        for claim in claims
    ]
    lines = [headings, ["---"] * len(headings), *(row[: len(headings)] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def printed_table(printed: dict[str, Any]) -> str:
    """Return the article's printed values beside ours, as Markdown.

    Args:
        printed: The value of that key in `results/article.json`.
    """
    values = {
        "DQN's test, total of 1,000 steps": printed["dqn"],
        "SAC's test, total of 1,000 steps": printed["sac"],
        "PGPE, mean fitness at generation 100": printed["pgpe"],
        "PGPE's film, return of 1,000 steps": printed["pgpe"]["film"],
    }
    rows = [
        f"| {name} | {wording.number(own['value'])} | "
        f"{wording.estimate(own['median'], own['low'], own['high'], len(own['ours']))} | "
        f"{_judgement(own)} |"
        for name, own in values.items()
    ]
    head = (
        "| value | printed | ours, median of the seeds | tests as far out | p | reproduced |\n"
        "|---|---|---|---|---|---|"
    )
    if control := printed["dqn"].get("control"):
        share = {name: wording.percent(own) for name, own in control["probability"].items()}
        reached, every = sum(control["tests"]["reached"]), control["tests"]["each"]
        rows.append(
            f"| always command {control['command']}, tested as DQN | "
            f"{wording.number(printed['dqn']['value'])} | mean {wording.number(control['mean'])} | "
            f"{reached} of {every:,}: {share['value']} [{share['low']}–{share['high']}] % | | |"
        )
    return "\n".join([head, *rows])


def runs_table(summary: dict[str, Any]) -> str:
    """Return DQN's runs with other versions and contacts, and their differences, as Markdown.

    Args:
        summary: What `article_runs.summary` returns.
    """
    runs = [
        f"| `{name}` | {len(own['means'])} | "
        f"{wording.estimate(np.median(own['means']), min(own['means']), max(own['means']), 2)} | "
        f"{_judgement(own)} |"
        for name, own in summary["runs"].items()
    ]
    pairs = [
        f"| `{pair['first']}` against `{pair['second']}` | {wording.percent(pair['probability'])} "
        f"[{wording.percents(pair['low'], pair['high'])}] % | {wording.p_value(pair['p'])} |"
        for pair in summary["pairs"]
    ]
    lines = [
        "| run | policies | their mean returns: median [all] | tests as far out | p | reproduced |",
        "|---|---|---|---|---|---|",
        *runs,
        "",
        "| runs | a policy of the first returns more than one of the second | p, exact rank test |",
        "|---|---|---|",
        *pairs,
    ]
    return "\n".join(lines)


def _judgement(own: dict[str, Any]) -> str:
    """Return three cells of a printed value: how many tests lay as far out, p, and the verdict."""
    tests, found = own["tests"], own["probability"]
    share = wording.percent(found["value"])
    interval = wording.percents(found["low"], found["high"])
    shares = f"{sum(tests['reached'])} of {len(tests['reached']) * tests['each']:,}"
    p, verdict = wording.p_value(found["p"]), VERDICTS[own["reproduced"]]
    return f"{shares}: {share} [{interval}] % | {p} | {verdict}"


def tuning_table(found: Sequence[dict[str, Any]]) -> str:
    """Return what searches found, as Markdown.

    Args:
        found: Summaries of `results/tuning/`, with those of controls.
    """
    lines = [
        "| agent | trials x seeds | ended early | before | after | difference | verdict | p | "
        "best after 1, 7, 30 trials | expected of random draws |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    controls = {own["agent"]: own["expected_best"] for own in found if "expected_best" in own}
    for own in found:
        if "verdict" not in own:
            continue
        num_trials = f"{own['trials']} x {own['seeds_per_trial']}"
        returns = [_number(own["before"]), _number(own["after"])]
        interval = f"[{wording.number(own['low'])}, {wording.number(own['high'])}]"
        cells = [
            *(own["agent"], num_trials, str(own["pruned"]), *returns),
            f"{wording.number(own['difference'])} {interval}",
            *(own["verdict"], wording.p_value(own["p"])),
            ", ".join(map(_number, own["best_after"].values())),
            ", ".join(map(_number, controls.get(own["agent"], {}).values())),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _number(value: float | None) -> str:
    return "" if value is None else wording.number(value)


def published_table(root: Path) -> str:
    """Return SAC's returns in validation beside published ones, as Markdown.

    Args:
        root: The project's folder, with the models of `presets/run`.

    Raises:
        InputError: SAC was not validated at these numbers of control steps.
    """
    params = params_file.load(Paths(root).params)
    ours = [curves.evaluations(curves.read(root, params, "sac", seed)) for seed in params.seeds]
    published = tables.read(PUBLISHED, "train@sac", {}, PUBLISHED_COLUMNS)
    lines = ["| control steps | SAC here | published |", "|---|---|---|"]
    for steps in PUBLISHED_STEPS:
        here = [returns[places == steps] for places, returns in ours]
        if not all(map(len, here)):
            raise InputError(
                f"{Paths(root).agent('sac').models}: given no validation at {steps:,} control "
                "steps; run `make preset PRESET=run` first"
            )
        theirs = published["return"][published["env_steps"] == steps]
        cells = [_median_of(np.concatenate(here)), _median_of(theirs)]
        lines.append(f"| {steps:,} | {' | '.join(cells)} |")
    return "\n".join(lines)


def kept_table(withstood: dict[str, Any]) -> str:
    """Return what agents keep of their return under each perturbation, as Markdown.

    Of each agent the share at the most severe level, in per cent, and the level from which on a
    metronome is ahead.
    """
    agents = withstood["agents"]
    lines = [f"| perturbation | {' | '.join(agents)} |", f"|---{'|---' * len(agents)}|"]
    for name in withstood["perturbations"]:
        cells = []
        for own in (agent[name] for agent in agents.values()):
            share = own["retention"][-1]
            kept = "–" if share is None else wording.percent(share)
            ahead = own["crossing"]
            cells.append(kept if ahead is None else f"{kept} (from {ahead:g} on)")
        lines.append(f"| {name.replace('_', ' ')} | {' | '.join(cells)} |")
    return "\n".join(lines)


def finals_table(rows: Sequence[dict[str, str]]) -> str:
    """Return published methods by their mean return over seeds, as Markdown."""
    lines = ["| method | seeds | mean return | all |", "|---|---|---|---|"]
    for method in dict.fromkeys(row["method"] for row in rows):
        own = sorted(float(row["return"]) for row in rows if row["method"] == method)
        every = ", ".join(f"{value:,.0f}" for value in own)
        lines.append(f"| {method} | {len(own)} | {np.mean(own):,.0f} | {every} |")
    return "\n".join(lines)


def _median_of(returns: np.ndarray) -> str:
    """Return the median of seeds' returns, and all of them in order."""
    every = ", ".join(f"{value:,.0f}" for value in sorted(returns))
    return f"**{np.median(returns):,.0f}** ({every})"


def animation() -> bytes:
    """Return the learners' films side by side, looping, as an animated picture."""
    agents = params_file.load().agents
    labels = {
        name: catalogue.label(name, agent.algorithm)
        for name, agent in agents.items()
        if not agent.is_baseline
    }
    films = [clip(PROJECT_ROOT / "media" / f"{name}.mp4", label) for name, label in labels.items()]
    pictures = [beside(row) for row in zip(*films, strict=True)]
    content = io.BytesIO()
    pictures[0].save(
        content,
        format="WEBP",
        save_all=True,
        append_images=pictures[1:],
        duration=round(1000 / FPS),
        loop=0,
        quality=55,
        method=6,
    )
    return content.getvalue()


def clip(path: Path, label: str) -> list[Image.Image]:
    """Return the pictures of a film that the animation shows, small and labelled."""
    reader: Any = imageio.get_reader(path, format="FFMPEG")  # FFMPEG's type, not the declared one
    with reader:
        fps = reader.get_meta_data()["fps"]
        numbers = [round((START + i / FPS) * fps) for i in range(round(SECONDS * FPS))]
        pictures = [Image.fromarray(reader.get_data(number)) for number in numbers]
    small = [picture.resize((SIDE, SIDE), Image.Resampling.LANCZOS) for picture in pictures]
    for picture in small:
        ImageDraw.Draw(picture).text((12, 8), label, "white", FONT)
    return small


def beside(pictures: Sequence[Image.Image]) -> Image.Image:
    """Return pictures of one size side by side."""
    row = Image.new("RGB", (SIDE * len(pictures), SIDE))
    for number, picture in enumerate(pictures):
        row.paste(picture, (SIDE * number, 0))
    return row


if __name__ == "__main__":
    with reported():
        main()

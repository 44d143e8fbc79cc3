"""Results as the Markdown tables of the documents."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.experiment import curves, params_file, summaries
from jumping_ant.looks import style
from jumping_ant.looks.style import p_value
from jumping_ant.tuning.outcome import is_control_of

VERDICTS = {True: "yes", False: "no", None: "open"}  # whether a printed value is reproduced
PUBLISHED = PROJECT_ROOT / "docs" / "published" / "ant_sac.csv"
PUBLISHED_COLUMNS = {"seed": tables.SEED, "env_steps": curves.COUNT, "return": tables.Column()}
PUBLISHED_STEPS = (100_000, 200_000)


def claim_table(claims: Sequence[dict[str, Any]]) -> str:
    """Return the claims, their verdicts, adjusted p values and evidence as Markdown."""
    headings = ["claim", "verdict", "adjusted p", "evidence"]
    rows = [
        [claim["text"], claim["verdict"], p_value(summaries.deciding_p(claim)), claim["evidence"]]
        for claim in claims
    ]
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def replication_table(first: dict[str, Any], again: dict[str, Any]) -> str:
    """Return the verdicts of the default beside those on other seeds, as Markdown.

    Args:
        first: What `publish.everything` returns of the default.
        again: The same of `presets/replicate`.
    """
    lines = ["| claim | default | adjusted p | other seeds | adjusted p |", f"{'|---' * 5}|"]
    for key in ("claims", "robustness"):
        anew = {claim["text"]: claim for claim in again[key]}
        for claim in first[key]:
            cells = [claim["text"]]
            for own in (claim, anew[claim["text"]]):
                cells += [own["verdict"], p_value(summaries.deciding_p(own))]
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


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
        f"| {name} | {style.number(own['value'])} | "
        f"{style.estimate(own['median'], own['low'], own['high'], len(own['ours']))} | "
        f"{_judgement(own)} |"
        for name, own in values.items()
    ]
    head = (
        "| value | printed | ours, median of the seeds | tests as far out | p | reproduced |\n"
        "|---|---|---|---|---|---|"
    )
    if control := printed["dqn"].get("control"):
        share = {name: style.percent(own) for name, own in control["probability"].items()}
        reached, every = sum(control["tests"]["reached"]), control["tests"]["each"]
        rows.append(
            f"| always command {control['command']}, tested as DQN | "
            f"{style.number(printed['dqn']['value'])} | mean {style.number(control['mean'])} | "
            f"{reached} of {every:,}: {share['value']} [{share['low']}–{share['high']}] % | | |"
        )
    return "\n".join([head, *rows])


def _judgement(own: dict[str, Any]) -> str:
    """Return three cells of a printed value: how many tests lay as far out, p, and the verdict."""
    tests, found = own["tests"], own["probability"]
    share = style.percent(found["value"])
    interval = style.percents(found["low"], found["high"])
    shares = f"{sum(tests['reached'])} of {len(tests['reached']) * tests['each']:,}"
    p, verdict = style.p_value(found["p"]), VERDICTS[own["reproduced"]]
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
    for own in found:
        if "verdict" not in own:
            continue
        controls = [other["expected_best"] for other in found if is_control_of(other, own)]
        num_trials = f"{own['trials']} x {own['seeds_per_trial']}"
        returns = [_number(own["before"]), _number(own["after"])]
        difference = p = ""
        if own["p"] is not None:  # else nothing was trained for a verdict
            interval = f"[{style.number(own['low'])}, {style.number(own['high'])}]"
            difference = f"{style.number(own['difference'])} {interval}"
            p = style.p_value(own["p"])
        cells = [
            *(own["agent"], num_trials, str(own["pruned"]), *returns),
            *(difference, own["verdict"], p),
            ", ".join(map(_number, own["best_after"].values())),
            ", ".join(map(_number, controls[0].values() if controls else [])),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _number(value: float | None) -> str:
    return "" if value is None else style.number(value)


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
    metronome is ahead by more than the margin.
    """
    agents = withstood["agents"]
    lines = [f"| perturbation | {' | '.join(agents)} |", f"|---{'|---' * len(agents)}|"]
    for name in withstood["perturbations"]:
        cells = []
        for own in (agent[name] for agent in agents.values()):
            share = own["retention"][-1]
            kept = "–" if share is None else style.percent(share)
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

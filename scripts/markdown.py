"""Results as the Markdown tables of the documents, and their places there."""

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jumping_ant.base import tables
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import Paths
from jumping_ant.comparison.results import deciding_p
from jumping_ant.media import style
from jumping_ant.params import params_file
from jumping_ant.params.claims import Claim
from jumping_ant.training import curves
from jumping_ant.tuning.outcome import is_control_of

VERDICTS = {True: "yes", False: "no", None: "open"}  # whether a printed value is reproduced
PUBLISHED = PROJECT_ROOT / "docs" / "published" / "ant_sac.csv"
PUBLISHED_COLUMNS = {"seed": tables.SEED, "env_steps": curves.COUNT, "return": tables.Column()}
PUBLISHED_STEPS = (100_000, 200_000)


def replaced(document: Path, text: str, name: str, content: str) -> str:
    """Return a document's text with other content between a name's marks, which are comments.

    Raises:
        InputError: The document lacks a mark.
    """
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    head, mark, rest = text.partition(begin)
    if not mark or end not in rest:
        raise InputError(f"{document}: given no {begin.strip()} ... {end}, between which to write")
    return f"{head}{begin}{content.rstrip()}\n{end}{rest.partition(end)[2]}"


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as Markdown."""
    lines = [f"| {' | '.join(cells)} |" for cells in (headings, *rows)]
    return "\n".join([lines[0], "|---" * len(headings) + "|", *lines[1:]])


def claim_table(claims: Iterable[dict[str, Any]]) -> str:
    """Return the claims, their verdicts, adjusted p values and evidence."""
    rows = []
    for claim in claims:
        p = style.p_value(deciding_p(claim))
        rows.append([claim["text"], claim["verdict"], p, claim["evidence"]])
    return table(["claim", "verdict", "adjusted p", "evidence"], rows)


def asked_table(asked: Iterable[Claim]) -> str:
    """Return claims that are to be tested."""
    rows = [
        [
            claim.text,
            claim.statement or "",
            ", ".join(f"`{it}`" for it in claim.measures),
            f"`{claim.agent}`, `{claim.against}`",
            claim.side,
            "" if claim.margin is None else style.number(claim.margin),
        ]
        for claim in asked
    ]
    return table(["claim", "the article", "measure", "agents", "side", "margin"], rows)


def printed_table(printed: dict[str, Any]) -> str:
    """Return the article's printed values beside ours, as `results/article.json` has them."""
    values = {
        "DQN's test, total of 1,000 steps": printed["dqn"],
        "SAC's test, total of 1,000 steps": printed["sac"],
        "PGPE, mean fitness at generation 100": printed["pgpe"],
        "PGPE's film, return of 1,000 steps": printed["pgpe"]["film"],
    }
    rows = []
    for name, value in values.items():
        median = style.estimate(value["median"], value["low"], value["high"], len(value["ours"]))
        p, verdict = style.p_value(value["probability"]["p"]), VERDICTS[value["reproduced"]]
        rows.append([name, style.number(value["value"]), median, _share(value), p, verdict])
    if control := printed["dqn"].get("control"):
        name, mean = f"always command {control['command']}, tested as DQN", control["mean"]
        target = style.number(printed["dqn"]["value"])
        rows.append([name, target, f"mean {style.number(mean)}", _share(control), "", ""])
    headings = ["value", "printed", "ours, median of the seeds", "tests as far out"]
    return table([*headings, "p", "reproduced"], rows)


def traces_table(printed: dict[str, Any]) -> str:
    """Return all numbers that the article prints of its tests and of PGPE's training."""
    traces = {
        f"{name.upper()}, total of a test": printed[name]["points"] for name in ("dqn", "sac")
    }
    for name, points in printed["pgpe"]["traces"].items():
        traces[f"PGPE, {name.partition('_')[2]} fitness"] = points
    rows = []
    for name, points in traces.items():
        for point in points:
            ours = style.estimate(point["median"], point["low"], point["high"], len(point["ours"]))
            verdict = VERDICTS[point["reproduced"]]
            rows.append([name, str(point["at"]), style.number(point["value"]), ours, verdict])
    counts = Counter(row[-1] for row in rows)
    told = ", ".join(f"{counts[word]} {word}" for word in VERDICTS.values())
    shown = table(["printed", "step, or generation", "value", "ours", "reproduced"], rows)
    return f"{len(rows)} numbers: {told}.\n\n{shown}"


def hours_table(training: dict[str, Any]) -> str:
    """Return the minutes of a training, in the median of the seeds, beside those it states."""
    rows = [
        [name.upper(), f"{60 * training['stated_hours'][name]:.0f}", f"{np.median(own) / 60:.1f}"]
        for name, own in training["seconds"].items()
    ]
    return table(["training", "stated [min]", "here [min]"], rows)


def _share(value: dict[str, Any]) -> str:
    """Return how many tests reached a printed value, and the probability [%] with its interval."""
    reached, each = value["tests"]["reached"], value["tests"]["each"]
    chance = value["probability"]
    interval = style.percents(chance["low"], chance["high"])
    of = f"{sum(reached)} of {len(reached) * each:,}"
    return f"{of}: {style.percent(chance['value'])} [{interval}] %"


def tuning_table(searches: Sequence[dict[str, Any]]) -> str:
    """Return what searches for settings found, from summaries with those of controls."""
    rows = []
    for search in searches:
        if "verdict" not in search:
            continue
        controls = [other["expected_best"] for other in searches if is_control_of(other, search)]
        difference = p = ""
        if search["p"] is not None:  # else nothing was trained for a verdict
            difference = style.number(search["difference"])
            if search["low"] is not None:
                difference += f" [{style.number(search['low'])}, {style.number(search['high'])}]"
            p = style.p_value(search["p"])
        num_trials = f"{search['trials']} x {search['seeds_per_trial']}"
        cells = [search["agent"], num_trials, str(search["pruned"])]
        cells += [_number(search["before"]), _number(search["after"])]
        cells += [difference, search["verdict"], p]
        cells += [", ".join(map(_number, search["best_after"].values()))]
        cells += [", ".join(map(_number, controls[0].values() if controls else []))]
        rows.append(cells)
    headings = ["agent", "trials x seeds", "ended early", "before", "after", "difference"]
    headings += ["verdict", "p", "best after 1, 7, 30 trials", "expected of random draws"]
    return table(headings, rows)


def _number(value: float | None) -> str:
    return "" if value is None else style.number(value)


def published_table(root: Path) -> str:
    """Return SAC's returns in validation, from a run of `presets/run`, beside published ones.

    Raises:
        InputError: SAC was not validated at these numbers of control steps.
    """
    params = params_file.load(Paths(root).params)
    ours = [curves.evaluations(curves.read(root, "sac", seed)) for seed in params.seeds]
    published = tables.read(PUBLISHED, "train@sac", {}, PUBLISHED_COLUMNS)
    rows = []
    for steps in PUBLISHED_STEPS:
        here = [returns[places == steps] for places, returns in ours]
        if not all(map(len, here)):
            raise InputError(
                f"{Paths(root).agent('sac').models}: given no validation at {steps:,} control "
                "steps; run `make preset PRESET=run` first"
            )
        theirs = published["return"][published["env_steps"] == steps]
        rows.append([f"{steps:,}", _median_of(np.concatenate(here)), _median_of(theirs)])
    return table(["control steps", "SAC here", "published"], rows)


def kept_table(withstood: dict[str, Any]) -> str:
    """Return the share [%] of its return that each agent keeps at a perturbation's last level."""
    agents = withstood["agents"]
    rows = []
    for name in withstood["perturbations"]:
        cells = [name.replace("_", " ")]
        for perturbed in (agent[name] for agent in agents.values()):
            share = perturbed["retention"][-1]
            cells.append("–" if share is None else style.percent(share))
        rows.append(cells)
    return table(["perturbation", *agents], rows)


def finals_table(path: Path) -> str:
    """Return published methods by their mean return over seeds, from a table of both."""
    returns = pd.read_csv(path, dtype={"method": str}).groupby("method", sort=False)["return"]
    rows = [
        [method, str(len(values)), f"{np.mean(values):,.0f}", _in_order(values)]
        for method, values in returns
    ]
    return table(["method", "seeds", "mean return", "all"], rows)


def _median_of(returns: np.ndarray) -> str:
    """Return the median of seeds' returns, and all of them in order."""
    return f"**{np.median(returns):,.0f}** ({_in_order(returns)})"


def _in_order(returns: Iterable[float]) -> str:
    return ", ".join(f"{value:,.0f}" for value in sorted(returns))

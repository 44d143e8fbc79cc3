"""Add seeds to the agents of open claims until all are decided or the last look is over.

Usage: python -m scripts.decide [--folder FOLDER]

docs/claims.md fixes beforehand how often claims are looked at, with which level and how many seeds.
The added seeds are trained and evaluated in a copy of the project, `.decide/`, where a stopped run
resumes and DVC trains only what is new. The project's own results do not change. Reads those of
`make repro`, which must be up to date, and writes results/decided.json: the looks, and all claims
with their last verdicts.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from jumping_ant.base import command_line, output, telemetry
from jumping_ant.base.errors import InputError, reported
from jumping_ant.base.files import PROJECT_ROOT, write_json
from jumping_ant.comparison import results
from jumping_ant.comparison.claims import verdicts
from jumping_ant.experiment import params_file
from jumping_ant.experiment.models import Params
from scripts import cost, preset, stale

FOLDER = PROJECT_ROOT / ".decide"
Run = Callable[[Path, Params, Sequence[str]], None]


def main() -> None:
    """Parse the command line, train and judge."""
    parser = command_line.parser(__doc__)
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where the seeds are trained")
    folder = parser.parse_args().folder
    telemetry.switch_off()
    refuse_stale(PROJECT_ROOT)
    content = decide(PROJECT_ROOT, folder, params_file.load(), preset.run)
    write_json(PROJECT_ROOT / "results" / "decided.json", content)
    left, looks = sum(map(verdicts.is_open, content["claims"])), len(content["looks"])
    print(f"{left} of {len(content['claims'])} claims are open after {looks} later looks")


def refuse_stale(root: Path) -> None:
    """Raise an InputError unless a project's results are those of its settings and code.

    Seeds are added with these, and one sample must not mix them with others.
    """
    if stages := stale.look(root, ["compare"]):
        raise InputError(
            "results: given those of other settings or code, to which no seeds can be added "
            f"(to run again: {cost.summary(stages)}), allowed: up-to-date ones; "
            "run `make repro` first"
        )


def decide(root: Path, folder: Path, params: Params, train: Run) -> dict[str, Any]:
    """Return the later looks, and the claims after them.

    Args:
        root: Folder of the project whose claims are looked at again.
        folder: Folder of the copy in which seeds are added.
        params: Those of the project.
        train: Runs stages with other parameters in the copy.
    """
    compare, episodes = params.compare, params.training.evaluation_episodes
    own = results.load(root, params)
    claims = verdicts.check(own, compare, episodes)
    looks: list[dict[str, Any]] = []
    for look in range(1, len(compare.levels)):
        open_claims = [claim for claim in claims if verdicts.gets_later_looks(claim, own)]
        if not open_claims:
            break
        names = {name for claim in open_claims for name in claim["agents"]}
        more = with_more_seeds(params, names, look)
        train(folder, more, [f"evaluate@{name}" for name in more.agents])
        together = results.joined(own, results.load(folder, more))
        claims = verdicts.check_again(claims, together, compare, episodes, look)
        looks.append(
            {
                "level": compare.levels[look],
                "added_seeds": more.seeds,
                "agents": list(more.agents),
                "open_before": [claim["text"] for claim in open_claims],
            }
        )
    return {"looks": looks, "claims": claims}


def with_more_seeds(params: Params, names: set[str], look: int) -> Params:
    """Return the parameters of the seeds that some agents have more after a look.

    None of them may imitate another.
    """
    first, count = max(params.seeds) + 1, look * params.compare.look_seeds
    changed = {
        "seeds": list(range(first, first + count)),
        "agents": {name: block for name, block in params.agents.items() if name in names},
        "demonstrations": {},
    }
    return Params.model_validate(dict(params) | changed)


if __name__ == "__main__":
    output.tolerate_failures()
    with reported():
        main()

"""What a study found: its trials as a table, a summary, and a preset of better settings.

Return against tuning budget: the best of n random draws, on average over which of the trials come
first, says what n trials are worth (Dodge et al. 2019, "Show Your Work", section 3; here without
its bias, as Tang et al. 2020, "Showing Your Work Doesn't Always Work", section 3.2). A sampler that
learns draws no such sample; of it only the best after n trials is known.
"""

import json
import math
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from optuna.importance import PedAnovaImportanceEvaluator
from optuna.trial import FrozenTrial, TrialState, create_trial

from jumping_ant.base import tables
from jumping_ant.base.files import to_json, write_all
from jumping_ant.base.paths import StudyPaths
from jumping_ant.experiment import trials
from jumping_ant.params.blocks import TuningParams
from jumping_ant.tuning.search import REASON, Task, best_of, seeds_of, value_of
from jumping_ant.tuning.space import Space
from jumping_ant.tuning.study import SamplerName

# what of `tuning` in params.yaml the trials of a study depend on
OF_A_STUDY = {"seeds", "share", "episodes", "target_return", "spread_penalty", "prune_level"}
STATES = {TrialState.COMPLETE: "complete", TrialState.PRUNED: "pruned"}
BUDGETS = (1, 7, 30)  # trials after which the best is told
GOOD = 0.25  # share of the trials that importance sets apart from the others


def rows(trials: Sequence[FrozenTrial], space: Space, tuning: TuningParams) -> list[dict[str, Any]]:
    """Return the table of ended trials; the settings are those that differ from the agent's own."""
    found = []
    for trial in trials:
        seeds, own = seeds_of(trial), value_of(trial, tuning)
        found.append(
            {
                "trial": trial.number,
                "state": STATES[trial.state],
                "value": "" if own is None else f"{own:.6g}",
                "returns": " ".join(f"{seed['return']:.6g}" for seed in seeds),
                "seconds": " ".join(f"{seed['seconds']:.3g}" for seed in seeds),
                "reason": trial.user_attrs.get(REASON, ""),
                "settings": json.dumps(space.chosen(trial.params)),
            }
        )
    return found


def summary(task: Task, sampler: SamplerName, study: optuna.Study) -> dict[str, Any]:
    """Return what the trials say, without the verdict."""
    space, tuning = task.space, task.tuning
    trials = study.get_trials(deepcopy=False, states=list(STATES))
    pruned = [trial for trial in trials if trial.state is TrialState.PRUNED]
    best = best_of(study)
    return {
        "agent": task.name,
        "sampler": sampler,
        "study": study.study_name,
        "trials": len(trials),
        "seeds_per_trial": tuning.seeds,
        "rules": {"task": task.digest, "ranges": space.described}
        | tuning.model_dump(include=OF_A_STUDY),
        "pruned": len(pruned),
        "without_value": sum(value_of(trial, tuning) is None for trial in trials),
        "best_trial": best.number if best else None,
        "best_value": best.values[0] if best else None,
        "settings": space.changes(space.agent_with(best.params)) if best else {},
        "best_after": best_after(values(trials, tuning)),
        "importance": importance(as_complete(study, tuning)),
    } | (_of_draws(trials, tuning) if sampler == "random" else {})


def _of_draws(trials: Sequence[FrozenTrial], tuning: TuningParams) -> dict[str, Any]:
    """Return the values of random draws, and the expected best of so many, by their number.

    The first trial was not drawn, if it has the agent's own settings.
    """
    draws = values([trial for trial in trials if "fixed_params" not in trial.system_attrs], tuning)
    best = {str(num): expected_best(draws, num) for num in BUDGETS if num <= len(draws)}
    return {"draws": draws, "expected_best": best}


def is_control_of(control: Mapping[str, Any], search: Mapping[str, Any]) -> bool:
    """Return whether one summary's random draws can be set beside another's trials.

    Both must be of the same robot, reward, budget and own settings (`Task.digest`), have drawn from
    the same ranges, and valued trials by the same rules.
    """
    return (
        "draws" in control
        and control["agent"] == search["agent"]
        and control.get("rules") == search["rules"]
    )


def values(trials: Sequence[FrozenTrial], tuning: TuningParams) -> list[float]:
    """Return the trials' values; [] if none is complete.

    One that ended early counts by its seeds so far, but not above those that are complete; one
    without a value has the least of all.
    """
    own = [value_of(trial, tuning) for trial in trials]
    most = max(
        (trial.values[0] for trial in trials if trial.state is TrialState.COMPLETE), default=None
    )
    if most is None:
        return []
    least = min(value for value in own if value is not None)
    return [least if value is None else min(value, most) for value in own]


def best_after(of_trials: Sequence[float]) -> dict[str, float]:
    """Return the best value of the first trials, by their number."""
    return {str(num): max(of_trials[:num]) for num in BUDGETS if num <= len(of_trials)}


def expected_best(of_draws: Sequence[float], num: int) -> float:
    """Return the mean over all choices of `num` of the draws of the best among them.

    The value of rank i is the best of comb(i - 1, num - 1) of the comb(n, num) choices.
    """
    ordered = np.sort(np.array(of_draws, dtype=np.float64))
    ranks = range(1, len(ordered) + 1)
    shares = [math.comb(i - 1, num - 1) / math.comb(len(ordered), num) for i in ranks]
    return float(ordered @ np.array(shares))


def as_complete(study: optuna.Study, tuning: TuningParams) -> optuna.Study:
    """Return a study in memory in which pruned trials have the values of their seeds so far.

    Optuna leaves pruned trials out of its analyses, which would then see only what is good.
    """
    shown = optuna.create_study(direction="maximize")
    for trial in study.get_trials(deepcopy=False, states=list(STATES)):
        if (own := value_of(trial, tuning)) is not None:
            shown.add_trial(
                create_trial(value=own, params=trial.params, distributions=trial.distributions)
            )
    return shown


def importance(shown: optuna.Study) -> dict[str, float]:
    """Return how much each setting sets good trials apart from the others, as shares.

    Source: Watanabe et al. 2023, "PED-ANOVA".
    """
    if len(shown.trials) < 2 / GOOD:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that few trials say little
        return optuna.importance.get_param_importances(
            shown, evaluator=PedAnovaImportanceEvaluator(target_quantile=GOOD)
        )


def preset(name: str, space: Space, settings: Mapping[str, Any], content: Any) -> str:
    """Return the list of overrides that makes an agent's settings those of a trial.

    Args:
        name: The agent's name.
        space: The agent as it is.
        settings: What the trial changes.
        content: Of `params.yaml`: an agent that it lacks is added as a whole.
    """
    agents = content["agents"]
    if name not in agents:
        block = space.agent.model_dump() | dict(settings)
        return f"-S +agents.{name}={_flow(block)}\n"
    return "".join(
        f"-S {'' if key in agents[name] else '+'}agents.{name}.{key}={_flow(value)}\n"
        for key, value in settings.items()
    )


def write(
    paths: StudyPaths,
    table: Sequence[Mapping[str, Any]],
    found: Mapping[str, Any],
    page: str,
    better: str | None = None,
) -> None:
    """Write a study's files; a preset of an earlier verdict is removed if nothing is better."""
    contents: dict[Path, bytes | str] = {
        paths.trials: tables.to_csv(table, trials.COLUMNS),
        paths.summary: to_json(found),
        paths.page: page,
    }
    if better:
        contents[paths.preset] = better
    write_all(contents)
    if better is None and found["sampler"] == "tpe":
        paths.preset.unlink(missing_ok=True)


def _flow(value: Any) -> str:
    """Return a value as the command line of DVC takes it, without spaces."""
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}:{_flow(own)}" for key, own in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(_flow, value)) + "]"
    return str(value) if isinstance(value, str) else json.dumps(value)

"""What a study brought: its trials as a table, a summary, and a preset of better settings.

Return against tuning budget: the best of n random draws, on average over which of the trials come
first, says what n trials are worth (Dodge et al. 2019, "Show Your Work", section 3; here without
its bias, as Tang et al. 2020, "Showing Your Work Doesn't Always Work", section 3.2). A sampler that
learns draws no such sample; of it only the best after n trials is known.
"""

import json
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import optuna
from optuna.importance import PedAnovaImportanceEvaluator
from optuna.trial import FrozenTrial, create_trial

from jumping_ant.tuning.search import COMPLETE, ENDED, PRUNED, REASON, best_of, ended, notes_of
from jumping_ant.tuning.space import Space
from jumping_ant.tuning.task import Task

COLUMNS = ("trial", "state", "value", "returns", "seconds", "reason", "settings")
"""Number; `complete` or `pruned`; value, empty if there is none; return and training seconds of
each trained seed; why it ended early; as JSON the settings that differ from the agent's own."""
BUDGETS = (1, 7, 30)  # trials after which the best is stated
GOOD = 0.25  # share of the trials that importance sets apart from the others


def rows(task: Task, study: optuna.Study) -> list[dict[str, Any]]:
    """Return the table of ended trials."""
    table = []
    for trial in ended(study):
        notes = notes_of(trial)
        value, trained = task.value(notes), [note for note in notes if "fault" not in note]
        row = (
            *(trial.number, ENDED[trial.state], "" if value is None else f"{value:.6g}"),
            " ".join(f"{note['return']:.6g}" for note in trained),
            " ".join(f"{note['seconds']:.3g}" for note in trained),
            trial.user_attrs.get(REASON, ""),
            json.dumps(task.space.chosen(trial.params)),
        )
        table.append(dict(zip(COLUMNS, row, strict=True)))
    return table


def summary(task: Task, sampler: str, study: optuna.Study) -> dict[str, Any]:
    """Return what the trials say, without the verdict."""
    trials, best = ended(study), best_of(study)
    result = {
        "agent": task.name,
        "sampler": sampler,
        "study": study.study_name,
        "trials": len(trials),
        "seeds_per_trial": task.settings.seeds,
        "rules": task.rules,
        "pruned": sum(trial.state is PRUNED for trial in trials),
        "without_value": sum(task.value(notes_of(trial)) is None for trial in trials),
        "best_trial": best.number if best else None,
        "best_value": best.values[0] if best else None,
        "settings": task.space.changes(task.space.agent_with(best.params)) if best else {},
        "best_after": _by_budget(_values(trials, task), lambda values, num: max(values[:num])),
        "importance": _importance(trials, task),
    }
    if sampler == "random":  # the present settings were not drawn
        draws = _values([trial for trial in trials if task.space.chosen(trial.params)], task)
        result |= {"draws": draws, "expected_best": _by_budget(draws, _expected_best)}
    return result


def is_control_of(control: Mapping[str, Any], search: Mapping[str, Any]) -> bool:
    """Return whether one summary's random draws are of the same task and rules as a search."""
    keys = ("agent", "rules")
    return "draws" in control and all(control.get(key) == search.get(key) for key in keys)


def _values(trials: Sequence[FrozenTrial], task: Task) -> list[float]:
    """Return the trials' values; [] if none is complete.

    One that ended early counts at most as the best complete one, one without a value as the least.
    """
    complete = [trial.values[0] for trial in trials if trial.state is COMPLETE]
    if not complete:
        return []
    every = [task.value(notes_of(trial)) for trial in trials]
    least = min(value for value in every if value is not None)
    return [least if value is None else min(value, max(complete)) for value in every]


def _by_budget(
    values: Sequence[float], best: Callable[[Sequence[float], int], float]
) -> dict[str, float]:
    return {str(num): best(values, num) for num in BUDGETS if num <= len(values)}


def _expected_best(draws: Sequence[float], num: int) -> float:
    """Return the mean over all choices of `num` of the draws of the best among them.

    The value of rank i is the best of comb(i, num - 1) of the comb(n, num) choices, from rank 0.
    """
    choices = math.comb(len(draws), num)
    ordered = enumerate(sorted(draws))
    return math.fsum(value * (math.comb(rank, num - 1) / choices) for rank, value in ordered)


def _importance(trials: Sequence[FrozenTrial], task: Task) -> dict[str, float]:
    """Return how much each setting sets good trials apart from the others, as shares.

    Trials that ended early have the values of their seeds so far, as Optuna would leave them out.
    Source: Watanabe et al. 2023, "PED-ANOVA".
    """
    study = optuna.create_study(direction="maximize")
    for trial in trials:
        if (value := task.value(notes_of(trial))) is not None:
            params, distributions = trial.params, trial.distributions
            study.add_trial(create_trial(value=value, params=params, distributions=distributions))
    if len(study.trials) < 2 / GOOD:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that few trials say little
        evaluator = PedAnovaImportanceEvaluator(target_quantile=GOOD)
        return optuna.importance.get_param_importances(study, evaluator=evaluator)


def preset(name: str, space: Space, settings: Mapping[str, Any], content: Any) -> str:
    """Return the overrides of a trial's settings; an agent that `params.yaml` lacks as a whole."""
    agents = content["agents"]
    if name not in agents:
        return f"-S +agents.{name}={_flow(space.agent.model_dump() | dict(settings))}\n"
    return "".join(
        f"-S {'' if key in agents[name] else '+'}agents.{name}.{key}={_flow(value)}\n"
        for key, value in settings.items()
    )


def _flow(value: Any) -> str:
    """Return a value as the command line of DVC takes it, without spaces."""
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{key}:{_flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(_flow, value)) + "]"
    return str(value) if isinstance(value, str) else json.dumps(value)

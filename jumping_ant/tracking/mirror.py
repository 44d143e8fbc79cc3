"""`track`: updates MLflow from the files, which are the source of truth.

A finished run is written once. Of the same policy and parameters, a run that shows something else
than the files or did not finish is replaced; other runs stay. When every policy of `params.yaml` is
trained, runs of seeds are nested under the comparison, beside a run of all seeds of each agent.
"""

from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

from mlflow.entities import Run

from jumping_ant.base.databases import without_password
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import home
from jumping_ant.params import params_file
from jumping_ant.tracking import models, pages, studies
from jumping_ant.tracking import records as files
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.connection import failures_as_input_errors, is_server, mirrored_alone
from jumping_ant.tracking.records import AGGREGATE, TRAIN_SECONDS, ComparisonRecord, SeedRecord
from jumping_ant.tracking.store import Content, Store


def track(
    root: Path = PROJECT_ROOT, say: Callable[[str], None] = print, pages_at: str | None = None
) -> None:
    """Bring MLflow up to date with a project's files.

    `say` receives one line for each change, and one at the end. With `pages_at`, where MLflow's
    pages will be served unless a server already serves them, a last one says where to look.
    """
    comparison = files.read(root, params_file.load(root / "params.yaml"))
    comparison.check()
    if comparison.missing:
        untrained = ", ".join(f"{agent} seed {seed}" for agent, seed in comparison.missing)
        say(f"not trained yet: {untrained}")
    store = stores.connect(root)
    with failures_as_input_errors(store.uri), mirrored_alone(store.uri, say):
        done = _mirror(store, comparison, say)
        store.close_abandoned()
        _describe_experiment(store)
    studies.track(root, say)
    counts = ", ".join(f"{count} {verb}" for verb, count in sorted(done.items()))
    name = without_password(store.uri)
    say(f"MLflow at {name}: {counts or 'nothing to show'}")
    if pages_at:
        base = f"{name.rstrip('/')}/" if is_server(store.uri) else pages_at
        say(f"Look at {base}{pages.address(store.experiment_id)}")


def _mirror(store: Store, comparison: ComparisonRecord, say: Callable[[str], None]) -> Counter[str]:
    """Mirror every file, and count the runs of seeds by what was done."""
    is_complete = comparison.seeds and not comparison.missing
    parent = _mirror_comparison(store, comparison, say) if is_complete else None
    done: Counter[str] = Counter()
    for agent in comparison.agents:
        models.create(store, agent)
        scores: dict[str, float] = {}
        for record in comparison.seeds:
            if record.agent == agent:
                run, verb = _mirror_seed(store, record, parent)
                done[verb] += 1
                _tell(say, f"{agent} seed {record.seed}", verb)
                if run and record.validation_return is not None:
                    scores[run.info.run_id] = record.validation_return
        # An experiment that DVC runs apart does not change what the workspace's champion is.
        is_workspace = home(comparison.root) == comparison.root.resolve()
        if is_workspace and (crowned := models.crown(store, agent, scores)):
            say(crowned)
    return done


def _mirror_comparison(
    store: Store, comparison: ComparisonRecord, say: Callable[[str], None]
) -> Run:
    """Return the run that runs of seeds are nested under, with runs of all seeds of each agent."""
    key, note = comparison.key, comparison.note
    stage = {stores.DVC_STAGE: "compare"}
    content = Content(
        name=f"comparison-{key[:8]}",
        tags={stores.COMPARISON: key, **stage},
        metrics=comparison.summary,
        artifacts=comparison.artifacts,
        aside={pages.NOTE: note} if note else {},
        commit=comparison.commit,
    )
    parent, verb = store.settle(content, store.search(f"tags.{stores.COMPARISON} = '{key}'"))
    _tell(say, content.name, verb)
    records = {record.agent: record for record in comparison.seeds}
    for agent, num_seeds in comparison.compared.items():
        if record := records.get(agent):
            tags = {stores.AGENT: agent, AGGREGATE: key, stores.ALGORITHM: record.algorithm}
            content = Content(
                name=f"{agent}, {num_seeds} seeds",
                tags={**tags, **stage, **pages.UNFOLDED},
                curve=comparison.curve_over_seeds(agent),
                metrics=comparison.over_seeds(agent),
                place={stores.PARENT: parent.info.run_id, pages.RUN_COLOUR: record.colour},
                commit=comparison.commit,
            )
            condition = f"tags.{AGGREGATE} = '{key}' and tags.{stores.AGENT} = '{agent}'"
            _, verb = store.settle(content, store.search(condition))
            _tell(say, content.name, verb)
    return parent


def _tell(say: Callable[[str], None], name: str, verb: str) -> None:
    if verb != "unchanged":
        say(f"{name}: {verb}")


def _mirror_seed(store: Store, record: SeedRecord, parent: Run | None) -> tuple[Run | None, str]:
    """Have a seed's files shown, and return the run and what was done."""
    seed_runs = store.seed_runs(record.agent, record.seed)
    runs = [run for run in seed_runs if stores.is_of(run, record.digest, record.params)]
    earlier = [run for run in runs if not stores.is_followed(run)]
    if runs and not earlier:
        return None, "in training, left to the process that follows it"
    is_live = any(stores.LIVE in run.data.tags for run in earlier)
    run, verb = store.settle(
        _seed_content(store, record, parent, is_live),
        earlier,
        partial(models.has, store),
        partial(models.log, store, record),
    )
    models.clear(store, record, run)
    if record.commit and stores.is_without_commit(run):
        models.name_commit(store, run, record.commit)
    return run, verb


def _seed_content(store: Store, record: SeedRecord, parent: Run | None, is_live: bool) -> Content:
    end = record.policy_path.stat().st_mtime_ns // 1_000_000
    start = end - round(1000 * record.summary.get(TRAIN_SECONDS, 0.0))
    note = {pages.NOTE: record.describe()}
    under = {stores.PARENT: parent.info.run_id} if parent else {}
    return Content(
        name=record.name,
        tags={
            **stores.seed_tags(record.agent, record.seed, record.algorithm),
            stores.POLICY_DIGEST: record.digest,
            stores.DVC_MD5: record.md5,
        },
        params=record.params,
        curve=record.curve,
        metrics=record.summary,
        artifacts=record.artifacts,
        aside=note | ({stores.LIVE: "true"} if is_live else {}),
        place={pages.RUN_COLOUR: record.colour} | under,
        start=start,
        end=end,
        times={step: start + round(1000 * after) for step, after in record.seconds.items()},
        commit=record.commit,
    )


def _describe_experiment(store: Store) -> None:
    """Give the experiment its saved view, and a description if it has none."""
    experiment = store.client.get_experiment(store.experiment_id)
    tags = pages.experiment_tags(store.experiment_id)
    note = experiment.tags.get(pages.NOTE, tags[pages.NOTE])
    for tag in stores.changed(experiment.tags, tags | {pages.NOTE: note}).items():
        store.client.set_experiment_tag(store.experiment_id, *tag)

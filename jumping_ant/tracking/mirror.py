"""`track`: updates MLflow from the files. Files are the source of truth, MLflow mirrors them.

Runs are looked up by agent, seed, parameters and the digest of the policy file. A finished run is
written once: a second call leaves it alone, and one that shows something else than the files is
replaced. The run of a seed is nested under the comparison of the last call, which is looked up by
the digests of all its policies. While some policies of `params.yaml` are not trained yet, that is a
pending comparison.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

from mlflow.entities import Run

from jumping_ant.base.databases import without_password
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.base.paths import home
from jumping_ant.experiment import params_file
from jumping_ant.tracking import internals, pages, studies
from jumping_ant.tracking import records as files
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.connection import failures_as_input_errors, is_server, mirrored_alone
from jumping_ant.tracking.models import AgentModels
from jumping_ant.tracking.records import AGGREGATE, TRAIN_SECONDS, ComparisonRecord, SeedRecord
from jumping_ant.tracking.store import Content, Store

TIMEOUT_SECONDS = 20
MAX_RETRIES = 1
COMPARE_STAGE = "compare"


def track(
    root: Path = PROJECT_ROOT, say: Callable[[str], None] = print, pages_at: str | None = None
) -> None:
    """Bring MLflow up to date with a project's files.

    `say` receives one line for each change, and one at the end. With `pages_at`, where MLflow's
    pages will be served unless a server already serves them, a last one says where to look.
    """
    comparison = files.read(root, params_file.load(root / "params.yaml"))
    if comparison.missing:
        untrained = ", ".join(f"{agent} seed {seed}" for agent, seed in comparison.missing)
        say(f"not trained yet: {untrained}")
    store = stores.connect(root, TIMEOUT_SECONDS, MAX_RETRIES)
    with failures_as_input_errors(store.uri), mirrored_alone(store.uri, say):
        done = _mirror(store, comparison, say) if comparison.seeds else Counter[str]()
        store.clear_abandoned()
        _describe_experiment(store)
    studies.track(root, say)
    counts = ", ".join(f"{count} {verb}" for verb, count in sorted(done.items()))
    name = without_password(store.uri)
    say(f"MLflow at {name}: {counts or 'nothing to show'}")
    if pages_at:
        base = f"{name.rstrip('/')}/" if is_server(store.uri) else pages_at
        say(f"Look at {base}{pages.address(store.experiment_id)}")


def _mirror(store: Store, comparison: ComparisonRecord, say: Callable[[str], None]) -> Counter[str]:
    """Mirror every file; return how many runs of seeds were created, replaced and so on."""
    parent = _mirror_comparison(store, comparison, say)
    done: Counter[str] = Counter()
    for agent in comparison.agents:
        models = AgentModels(store, agent)
        for record in comparison.seeds:
            if record.agent == agent:
                done[_mirror_seed(store, record, parent, models, say)] += 1
        # An experiment that DVC runs apart does not change what the workspace's champion is.
        is_workspace = home(comparison.root) == comparison.root.resolve()
        if is_workspace and (crowned := models.crown()):
            say(crowned)
    return done


def _mirror_comparison(
    store: Store, comparison: ComparisonRecord, say: Callable[[str], None]
) -> Run:
    """Return the run that runs of seeds are nested under, with runs of all seeds of each agent."""
    if comparison.missing:
        return store.pending_comparison()
    key, settings = comparison.key, _settings(comparison)
    own = {stores.SETTINGS: settings, stores.DVC_STAGE: COMPARE_STAGE}

    def same(runs: list[Run]) -> list[Run]:
        """Return those with these parameters, on which the policies of baselines do not depend."""
        return [it for it in runs if it.data.tags.get(stores.SETTINGS, settings) == settings]

    complete = [it for it in store.comparisons() if _is_complete(store, it, comparison)]
    found = same(store.comparisons(key)) + complete
    content = Content(
        name=f"comparison-{key[:8]}",
        tags={stores.COMPARISON: key, **own},
        metrics=comparison.summary,
        artifacts=comparison.artifacts,
        aside={pages.NOTE: comparison.note} if comparison.note else {},
        start=min((it.info.start_time for it in found), default=None),
    )
    parent, is_new = store.settle(content, found)
    if is_new:
        say(f"comparison {key[:8]}: created")
    for agent, entry in comparison.results.get("agents", {}).items():
        record = next((it for it in comparison.seeds if it.agent == agent), None)
        if record is None:
            continue
        tags = {stores.AGENT: agent, AGGREGATE: key, stores.ALGORITHM: record.algorithm}
        metrics, curve = comparison.over_seeds(agent)
        content = Content(
            name=f"{agent}, {int(entry['seeds'])} seeds",
            tags={**tags, **own, **internals.UNFOLDED},
            curve=curve,
            metrics=metrics,
            place={stores.PARENT: parent.info.run_id, internals.RUN_COLOUR: record.colour},
        )
        condition = f"tags.{AGGREGATE} = '{key}' and tags.{stores.AGENT} = '{agent}'"
        _, is_new = store.settle(content, same(store.search(condition)))
        if is_new:
            say(f"{content.name}: created")
    return parent


def _settings(comparison: ComparisonRecord) -> str:
    """Return the digest of the parameters of all policies."""
    params = {record.name: record.params for record in comparison.seeds}
    return hashlib.sha256(json.dumps(params, sort_keys=True).encode()).hexdigest()


def _is_complete(store: Store, pending: Run, comparison: ComparisonRecord) -> bool:
    """Tell whether a pending comparison is over, with nothing but policies of this one."""
    records = {record.name: record for record in comparison.seeds}

    def is_own(run: Run) -> bool:
        record = records.get(str(run.info.run_name))
        return record is not None and stores.is_of(run, record.digest, record.params)

    children = store.search(stores.children_of(pending))
    return not stores.is_written(pending) and all(map(is_own, children))


def _mirror_seed(
    store: Store,
    record: SeedRecord,
    parent: Run,
    models: AgentModels,
    say: Callable[[str], None],
) -> str:
    """Write a run, if there is none that shows the files, and return what was done."""
    found = store.seed_runs(record.agent, record.seed)
    own = [run for run in found if stores.is_of(run, record.digest, record.params)]
    content = _seed_content(store, record, parent, own)
    run, verb = store.shown(content, found, models.has), "unchanged"
    if run is None and any(map(stores.is_followed, own)):
        say(f"{record.agent} seed {record.seed}: in training, left to the process that follows it")
        return "in training"
    if run is None:
        run = store.write(content, partial(models.log, record))
        verb = "replaced" if own else "created"
        say(f"{record.agent} seed {record.seed}: {verb}")
    for other in own:
        if other.info.run_id != run.info.run_id and not stores.is_followed(other):
            store.client.delete_run(other.info.run_id)
    models.settle(record, run, [other for other in found if other not in own])
    return verb


def _seed_content(store: Store, record: SeedRecord, parent: Run, replaced: list[Run]) -> Content:
    end = record.policy_path.stat().st_mtime_ns // 1_000_000
    start = end - round(1000 * record.summary.get(TRAIN_SECONDS, 0.0))
    live = {stores.LIVE: "true"} if any(stores.LIVE in it.data.tags for it in replaced) else {}
    # No run leaves a comparison for a pending one.
    is_pending = parent.data.tags[stores.COMPARISON] == stores.PENDING
    under = {stores.PARENT: parent.info.run_id}
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
        aside={**under, **live, pages.NOTE: record.describe(store.commit)},
        place={internals.RUN_COLOUR: record.colour, **({} if is_pending else under)},
        start=start,
        end=end,
        times={step: start + round(1000 * after) for step, after in record.seconds.items()},
    )


def _describe_experiment(store: Store) -> None:
    """Give the experiment its saved views and description; someone else's description is kept."""
    experiment = store.client.get_experiment(store.experiment_id)
    tags = pages.experiment_tags(store.experiment_id)
    if not experiment.tags.get(pages.NOTE, pages.ABOUT).startswith(pages.ABOUT):
        del tags[pages.NOTE]
    for tag in stores.changed(experiment.tags, tags).items():
        store.client.set_experiment_tag(store.experiment_id, *tag)

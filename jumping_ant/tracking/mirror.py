"""`track`: updates MLflow from the files. Files are the source of truth, MLflow mirrors them.

Runs are looked up by agent, seed, parameters and the digest of the policy file, and created,
repaired or left alone; a second call changes nothing, and a call after the store was wiped restores
it. The run of a seed is nested under a comparison, which is looked up by the digests of all its
policies. While some policies of `params.yaml` are not trained yet, that is a pending comparison.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from mlflow.entities import LoggedModel, Run
from mlflow.exceptions import MlflowException

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.experiment import params_file
from jumping_ant.tracking import internals, pages, records, studies
from jumping_ant.tracking import store as stores
from jumping_ant.tracking.connection import (
    ConflictError,
    failures_as_input_errors,
    mirrored_alone,
)
from jumping_ant.tracking.models import AgentModels
from jumping_ant.tracking.reading import Point
from jumping_ant.tracking.records import (
    AGGREGATE,
    TRAIN_SECONDS,
    AgentRecord,
    ComparisonRecord,
    SeedRecord,
)
from jumping_ant.tracking.store import Desired, Store
from jumping_ant.tracking.writers import is_own, is_written

TIMEOUT_SECONDS = 20
MAX_RETRIES = 1
COMPARE_STAGE = "compare"
ATTEMPTS = 4  # if another process mirrors the same policies at the same time


def track(
    root: Path = PROJECT_ROOT, say: Callable[[str], None] = print, pages_at: str | None = None
) -> None:
    """Bring MLflow up to date with a project's files.

    `say` receives one line for each change, and one at the end. With `pages_at`, where MLflow's
    pages will be served unless a server already serves them, a last one says where to look.
    """
    comparison = records.read(root, params_file.load(root / "params.yaml"))
    if comparison.missing:
        say(f"not trained yet: {comparison.missing_label}")
    store = stores.connect(root, TIMEOUT_SECONDS, MAX_RETRIES)
    for remaining in reversed(range(ATTEMPTS)):
        try:
            with failures_as_input_errors(store.uri), mirrored_alone(store.uri, say):
                done = _Mirror(store, comparison, say).run() if comparison.seeds else Counter[str]()
                store.clear_abandoned()
                _describe_experiment(store)
            break
        except ConflictError:
            if not remaining:
                raise
            say("another process is writing the same runs; retrying from the current state")
    studies.track(root, say)
    counts = ", ".join(f"{count} {verb}" for verb, count in sorted(done.items()))
    say(f"MLflow at {store.name}: {counts or 'nothing to show'}")
    if pages_at:
        base = f"{store.name.rstrip('/')}/" if store.is_server else pages_at
        say(f"Look at {base}{pages.address(store.experiment_id)}")


class _Mirror:
    """One pass over all files."""

    def __init__(
        self, store: Store, comparison: ComparisonRecord, say: Callable[[str], None]
    ) -> None:
        self._store = store
        self._comparison = comparison
        self._say = say

    def run(self) -> Counter[str]:
        """Mirror every file; return how many runs of seeds were created, repaired and so on."""
        done: Counter[str] = Counter()
        parent = self._open_comparison()
        for agent in self._comparison.agents:
            agent_models = AgentModels(self._store, agent)
            for record in self._comparison.seeds:
                if record.agent == agent:
                    done[self._mirror_seed(record, parent, agent_models)] += 1
            if crowned := agent_models.crown():
                self._say(crowned)
        self._close_comparison(parent)
        return done

    def _open_comparison(self) -> Run:
        if self._comparison.missing:
            return self._store.pending_comparison()
        key = self._comparison.key
        found = self._store.comparisons(key)
        for run in found[1:]:  # MLflow restores what was deleted with a deleted experiment
            self._store.client.delete_run(run.info.run_id)
        if found:
            return found[0]
        self._say(f"comparison {key[:8]}: created")
        name = f"comparison-{key[:8]}"
        tags = {stores.COMPARISON: key, stores.DVC_STAGE: COMPARE_STAGE}
        # It shows the machine's load during training.
        complete = next(filter(self._is_completed, self._store.comparisons()), None)
        if complete:
            return self._store.rename(complete, name, tags)
        return self._store.create_run(name, tags)

    def _is_completed(self, pending: Run) -> bool:
        """Tell whether a pending comparison is over, with nothing but policies of this one."""
        own = {record.name: record for record in self._comparison.seeds}
        return not is_written(pending) and all(
            run.info.run_name in own and self._is_of(run, own[run.info.run_name])
            for run in self._store.children(pending)
        )

    def _is_of(self, run: Run, record: SeedRecord) -> bool:
        """Tell whether a run is that of a policy, or was when its writer was killed."""
        if stores.is_unclaimed(run, record.params):
            return _agrees(self._store.curve_points(run), record.curve)
        return stores.shows(run, record.digest, record.params)

    def _close_comparison(self, run: Run) -> None:
        comparison, store = self._comparison, self._store
        if not comparison.missing:
            note = {pages.NOTE: comparison.note} if comparison.note else {}
            tags = note | _source_tags(run, COMPARE_STAGE)
            changes = store.apply(
                run, Desired(metrics=comparison.summary, tags=tags, artifacts=comparison.artifacts)
            )
            mirrored = [self._mirror_aggregate(own, run) for own in comparison.aggregates]
            changes |= {"aggregates": sum(mirrored)}
            if any(changes.values()):
                self._say(f"comparison {comparison.key[:8]}: updated ({_listed(changes)})")
        # A pending one may belong to a training that will be resumed.
        is_done = not comparison.missing and run.info.status != "FINISHED"
        if is_done or is_own(run):
            store.client.set_terminated(run.info.run_id, "FINISHED")

    def _mirror_aggregate(self, record: AgentRecord, parent: Run) -> bool:
        """Have a run of all seeds of an agent as the files say, and return if it was not."""
        store, key = self._store, self._comparison.key
        chosen, points = None, {}
        for run in store.aggregates(key, record.agent):
            stored = store.curve_points(run)
            if chosen is None and _agrees(stored, record.curve):
                chosen, points = run, stored
            else:
                store.client.delete_run(run.info.run_id)
        tags = {
            stores.AGENT: record.agent,
            AGGREGATE: key,
            stores.ALGORITHM: record.algorithm,
            stores.DVC_STAGE: COMPARE_STAGE,
            stores.PARENT: parent.info.run_id,
            internals.RUN_COLOUR: record.colour,
            **internals.UNFOLDED,
        }
        run = chosen or store.create_run(record.name, tags)
        tags |= _source_tags(run, COMPARE_STAGE)
        desired = Desired(curve=record.curve, metrics=record.summary, tags=tags)
        changes = store.apply(run, desired, points)
        if run.info.status != "FINISHED":
            store.client.set_terminated(run.info.run_id, "FINISHED")
        return chosen is None or any(changes.values())

    def _mirror_seed(self, record: SeedRecord, parent: Run, agent_models: AgentModels) -> str:
        """Create a run, repair it or leave it alone, and return which."""
        candidates = self._store.seed_runs(record.agent, record.seed)
        shown = [run for run in candidates if stores.shows(run, record.digest, record.params)]
        if any(_is_followed(run) for run in shown or candidates):
            self._say(f"{record.label}: in training, left to the process that follows it")
            return "in training"
        run, stored = self._choose(record, candidates)
        is_new = run is None
        if run is None:
            run = self._create(record, parent)
        model, model_changes = agent_models.mirror(record, run)
        desired = self._desired(record, run, parent, model)
        changes = self._store.apply(run, desired, stored) | model_changes
        if run.info.status != "FINISHED":
            end = None if stores.LIVE in run.data.tags else _end_ms(record)
            self._store.client.set_terminated(run.info.run_id, "FINISHED", end)
        elif not any(changes.values()):
            return "unchanged"
        verb = "created" if is_new else "repaired"
        self._say(f"{record.label}: {verb} ({_listed(changes)})")
        return verb

    def _choose(
        self, record: SeedRecord, candidates: Sequence[Run]
    ) -> tuple[Run | None, dict[Point, list[float]]]:
        """Return the run that shows the policy and its curve points, and delete its duplicates.

        A run written during training has no digest if its writer was killed; it is chosen if
        parameters and curve agree, and deleted if another shows the policy. MLflow cannot delete
        points, so a run of the policy whose points contradict the files is deleted, too.
        """
        own = [run for run in candidates if stores.shows(run, record.digest, record.params)]
        own.sort(key=lambda run: (run.info.status != "FINISHED", run.info.start_time))
        chosen, points = None, {}
        for run in own + [run for run in candidates if stores.is_unclaimed(run, record.params)]:
            stored = self._store.curve_points(run)
            is_right = _agrees(stored, record.curve)
            if chosen is None and is_right:
                chosen, points = run, stored
            elif run in own or is_right:
                kind = "second run" if is_right else "run that contradicted the files"
                self._store.client.delete_run(run.info.run_id)
                self._say(f"{record.label}: a {kind} was deleted")
        return chosen, points

    def _create(self, record: SeedRecord, parent: Run) -> Run:
        tags = {stores.POLICY_DIGEST: record.digest, stores.PARENT: parent.info.run_id}
        start = _end_ms(record) - round(1000 * record.summary.get(TRAIN_SECONDS, 0.0))
        return self._store.create_seed_run(record.agent, record.seed, record.algorithm, tags, start)

    def _desired(self, record: SeedRecord, run: Run, parent: Run, model: LoggedModel) -> Desired:
        tags = _seed_tags(record, run)
        if self._belongs_under(run, parent):
            tags |= {stores.PARENT: parent.info.run_id}
        start = run.info.start_time
        times = {step: start + round(1000 * after) for step, after in record.seconds.items()}
        return Desired(
            params=record.params,
            curve=record.curve,
            times=times,
            metrics=record.summary,
            tags=tags,
            artifacts=record.artifacts,
            model=model,
        )

    def _belongs_under(self, run: Run, parent: Run) -> bool:
        """Tell whether a run belongs under this comparison: the newest that contains it."""
        try:
            current = self._store.client.get_run(run.data.tags[stores.PARENT])
        except (KeyError, MlflowException):
            return True
        if current.info.lifecycle_stage == "deleted" or stores.is_pending(current):
            return True
        return not stores.is_pending(parent) and current.info.start_time <= parent.info.start_time


def _describe_experiment(store: Store) -> None:
    """Give the experiment its saved view and description; someone else's description is kept."""
    experiment = store.client.get_experiment(store.experiment_id)
    tags = pages.experiment_tags(store.experiment_id)
    if not experiment.tags.get(pages.NOTE, pages.ABOUT).startswith(pages.ABOUT):
        del tags[pages.NOTE]
    for tag in stores.changed(experiment.tags, tags).items():
        store.client.set_experiment_tag(store.experiment_id, *tag)


def _seed_tags(record: SeedRecord, run: Run) -> dict[str, str]:
    """Return the run tags that describe its policy, and those that MLflow's pages read."""
    return {
        stores.POLICY_DIGEST: record.digest,
        stores.DVC_MD5: record.md5,
        pages.NOTE: record.describe(run.data.tags.get(stores.GIT_COMMIT)),
        internals.RUN_COLOUR: record.colour,
        **internals.UNFOLDED,
        **_source_tags(run, record.stage),
    }


def _source_tags(run: Run, stage: str) -> dict[str, str]:
    return stores.source_tags(stage, run.data.tags.get(stores.GIT_COMMIT))


def _is_followed(run: Run) -> bool:
    return stores.LIVE in run.data.tags and is_written(run)


def _agrees(stored: Mapping[Point, Sequence[float]], curve: stores.Points) -> bool:
    """Tell whether every stored point is in the curve, with the same value, and stored once."""
    return all(
        len(values) == 1 and point in curve and stores.same(values[0], curve[point])
        for point, values in stored.items()
    )


def _listed(changes: Mapping[str, int]) -> str:
    return ", ".join(f"{kind} {count}" for kind, count in changes.items() if count) or "ended"


def _end_ms(record: SeedRecord) -> int:
    """Return when training ended, according to the policy file's time [ms since 1970]."""
    return record.policy_path.stat().st_mtime_ns // 1_000_000

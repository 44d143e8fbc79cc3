"""`params.yaml`: what is wrong is refused in one line a fault, all at once, whatever it is."""

import copy
import re
import shutil
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from changed_params import CONTENT, MISSING, changed, refusal
from hypothesis import given, settings
from hypothesis import strategies as st

from jumping_ant.agents import catalogue
from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.params import model, params_file, presets

RANDOM = CONTENT["agents"]["random"]
NAMES = "lower-case letters, digits, _ and -, the first a letter or digit"
# Nine lines of ten aliases each: billions of values in half a kilobyte.
LAUGHS = b"a0: &a0 [0]\n" + b"".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n".encode() for n in range(1, 10)
)
KEYS_OF_ENV = (
    "frame_skip, reset_noise_scale, drop_height, max_episode_steps, min_torso_height, "
    "max_torso_height, max_tilt, commands, reward"
)
ALGORITHMS = ", ".join(catalogue.ALGORITHMS)
ROBOTS = "ant, hopper, walker2d, half_cheetah, humanoid, or a file robots/NAME.xml"


def test_the_real_file_is_accepted_with_its_numbers() -> None:
    assert params_file.load().model_dump() == CONTENT


@pytest.mark.parametrize(
    ("agent", "numbers", "budget"),
    [
        ("random", {}, 0),
        ("metronome", {"half_periods": [2, 5], "episodes": 3, "episode_steps": 10}, 60),
        ("dqn", {"total_steps": 500, "num_envs": 2, "learning_starts": 0}, 500),
        ("sac", {"total_steps": 400, "num_envs": 1, "learning_starts": 0}, 400),
        ("pgpe", {"generations": 3, "population_size": 4, "episode_steps": 50}, 600),
    ],
)
def test_budgets_are_counted_in_control_steps(
    agent: str, numbers: dict[str, int], budget: int
) -> None:
    block = CONTENT["agents"][agent] | numbers
    assert (
        params_file.check(changed(f"agents.{agent}", block)).agents[agent].max_env_steps == budget
    )


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        # Keys.
        ("env.frameskip", 5, "unknown key (did you mean 'frame_skip'?); allowed: " + KEYS_OF_ENV),
        ("env.xyz", 5, "unknown key; allowed: " + KEYS_OF_ENV),
        ("agents.random.gamma", 0.9, "unknown key; allowed: algorithm, robot, actions"),
        ("agents.random.a\nb", 1, "unknown key; allowed: algorithm, robot, actions"),
        (
            "agents.sac.actions.hod",
            1,
            "unknown key (did you mean 'hold'?); allowed: kind, levels, amplitude, hold",
        ),
        ("agents.random.actions.hold", MISSING, "missing; it must be given"),
        ("env.frame_skip", MISSING, "missing; it must be given"),
        ("compare", MISSING, "missing; it must be given"),
        # Types.
        ("robot.density", "heavy", "given 'heavy', allowed: number or null"),
        ("env.drop_height", None, "given None, allowed: number"),
        ("env.drop_height", True, "given True, allowed: number"),
        ("env.frame_skip", 2.5, "given 2.5, allowed: integer"),
        ("env.frame_skip", "5", "given '5', allowed: integer"),
        ("robot", None, "given None, allowed: a block of keys"),
        ("env.reward", 5, "given 5, allowed: a block of keys"),
        ("agents.dqn", 7, "given 7, allowed: a block of keys"),
        ("robot.joint_gear", [1], "given [1], allowed: a block of keys"),
        ("robot.joint_gear", "x" * 99, f"given '{'x' * 56}..., allowed: a block of keys"),
        ("agents.pgpe.observation_normalization", 1, "given 1, allowed: true or false"),
        ("agents.sac.ent_coef", "automatic", "given 'automatic', allowed: number or 'auto'"),
        ("agents.sac.episode_steps", "long", "given 'long', allowed: integer or null"),
        ("agents.dqn.actions.hold", 1.5, "given 1.5, allowed: integer"),
        ("agents.dqn.actions", "commands", "given 'commands', allowed: a block of keys"),
        # Actions that an algorithm cannot take.
        ("agents.dqn.actions.kind", "torques", "given 'torques', allowed: 'commands'"),
        ("agents.sac.actions.kind", "commands", "given 'commands', allowed: 'torques'"),
        (
            "agents.random.actions.kind",
            "all",
            "given 'all', allowed: 'torques', 'commands' or 'levels'",
        ),
        ("agents.pgpe.actions.levels", 4, "given 4, allowed: 2 or 3 or null"),
        # Ranges.
        ("robot.density", 0, "given 0, allowed: greater than 0 or null"),
        ("robot.density", -2.5, "given -2.5, allowed: greater than 0 or null"),
        ("robot.joint_gear", {"ankle": -1}, "given -1, allowed: greater than 0"),
        ("env.reset_noise_scale", -0.1, "given -0.1, allowed: greater than or equal to 0"),
        ("env.reward.torso_height.span", 0.0, "given 0.0, allowed: greater than 0"),
        ("agents.dqn.gamma", 1.5, "given 1.5, allowed: less than or equal to 1"),
        ("agents.dqn.net_arch", [], "given [], allowed: at least one"),
        ("agents.sac.ent_coef", -1, "given -1, allowed: greater than 0 or 'auto'"),
        ("agents.dqn.actions.hold", 0, "given 0, allowed: greater than or equal to 1"),
        ("agents.sac.actions.amplitude", 1.5, "given 1.5, allowed: less than or equal to 1"),
        ("agents.random.actions.amplitude", 0, "given 0, allowed: greater than 0"),
        ("agents.metronome.amplitude", 2, "given 2, allowed: less than or equal to 1"),
        ("agents.metronome.half_periods", [], "given [], allowed: at least one"),
        ("agents.dqn.long_episodes", 1.1, "given 1.1, allowed: less than or equal to 1"),
        ("agents.dqn.episode_steps", 0, "given 0, allowed: greater than or equal to 1 or null"),
        ("agents.pgpe.population_size", 7, "given 7, allowed: a multiple of 2"),
        ("record.width", 65, "given 65, allowed: a multiple of 2"),
        ("compare.confidence", 1, "given 1, allowed: less than 1"),
        ("evaluate.seed", 2**31, "given 2147483648, allowed: less than 2147483648"),
        # Numbers that are none.
        ("env.reward.alive.weight", float("nan"), "given nan, allowed: a finite number"),
        ("env.reward.torso_height.floor", float("inf"), "given inf, allowed: a finite number"),
        ("env.drop_height", float("-inf"), "given -inf, allowed: a finite number"),
        ("env.commands", [[0.5, "up"]], "given 'up', allowed: number"),
        ("env.commands", [[0, 1.5]], "given 1.5, allowed: less than or equal to 1"),
        ("env.commands", [], "given [], allowed: at least one"),
        ("env.commands", [[0], [0, 1]], "given rows of 1 and of 2 torques, allowed: one per motor"),
        ("robot.source", "snake", f"given 'snake', allowed: {ROBOTS}"),
        (
            "robot.source",
            "robots/../../etc.xml",
            f"given 'robots/../../etc.xml', allowed: {ROBOTS}",
        ),
        ("seeds", {"a": 10**5000}, "given a number too long to show, allowed: list"),
        # Algorithms, agents and seeds.
        ("agents.random.trainer", "random", "unknown key; allowed: algorithm, robot, actions"),
        ("agents", {}, "given {}, allowed: at least one"),
        ("agents.Big One", RANDOM, f"given 'Big One', allowed: {NAMES}"),
        ("agents./etc", RANDOM, f"given '/etc', allowed: {NAMES}"),
        ("seeds", [], "given [], allowed: at least one"),
        ("seeds", 3, "given 3, allowed: list"),
    ],
)
def test_a_fault_is_one_line_with_key_given_and_allowed(key: str, value: Any, said: str) -> None:
    line = refusal(changed(key, value))
    inner = {"env.commands": {"up": ".0.1", "1.5": ".0.1"}, "robot.joint_gear": {"-1": ".ankle"}}
    where = key + next((at for what, at in inner.get(key, {}).items() if what in said), "")
    assert line == f"params.yaml: {where}: {said}".replace("\n", " ")


@pytest.mark.parametrize(
    ("key", "value", "line"),
    [
        (
            "agents.dqn.algorithm",
            "sarsa",
            f"agents.dqn.algorithm: given 'sarsa', allowed: {ALGORITHMS}",
        ),
        (
            "agents.dqn.algorithm",
            MISSING,
            f"agents.dqn.algorithm: missing; allowed: {ALGORITHMS}",
        ),
        (
            "agents.metronome.half_periods",
            [2, 0],
            "agents.metronome.half_periods.1: given 0, allowed: greater than or equal to 1",
        ),
        (
            "agents.pgpe.actions.levels",
            2,
            "agents.pgpe.actions: levels is 2, but kind torques takes none",
        ),
        (
            "agents.pgpe.actions.kind",
            "levels",
            "agents.pgpe.actions: levels is none, but kind levels takes 2 or 3",
        ),
        (
            "agents.dqn.actions.kind",
            "levels",
            "agents.dqn.actions.kind: given 'levels', allowed: 'commands'",
        ),
        ("seeds", [0, -1], "seeds.1: given -1, allowed: greater than or equal to 0"),
        (
            "seeds",
            [4, 5, 4],
            "the file: seeds holds 4 more than once; allowed: each seed once",
        ),
        (
            "agents.dqn",
            CONTENT["agents"]["dqn"]
            | {
                "total_steps": 31,
                "num_envs": 8,
                "train_freq": 2,
                "actions": {"kind": "commands", "amplitude": 0.5, "hold": 2},
            },
            "agents.dqn: total_steps is 31, but one round of num_envs x train_freq x actions.hold "
            "takes 32",
        ),
        (
            "agents.sac",
            CONTENT["agents"]["sac"] | {"total_steps": 600, "learning_starts": 200},
            "agents.sac: total_steps is 600, but learning_starts x actions.hold takes 600, after "
            "which it would begin to learn",
        ),
    ],
)
def test_faults_of_structure(key: str, value: Any, line: str) -> None:
    assert refusal(changed(key, value)) == f"params.yaml: {line}"


def test_too_many_seeds_are_refused_at_once(tmp_path: Path) -> None:
    started = time.perf_counter()
    line = refusal(changed("seeds", list(range(10**6))))
    assert line.startswith("params.yaml: seeds: given [0, 1, 2, 3")
    assert line.endswith("allowed: at most 1000")
    path = tmp_path / "params.yaml"
    path.write_text(f"seeds: {list(range(10**6))}\n", encoding="utf-8")
    with pytest.raises(InputError, match="params.yaml: given more, allowed: 200,000 characters"):
        params_file.load(path)
    assert time.perf_counter() - started < 10  # it took a minute


def test_long_names_are_refused_before_the_file_system_does() -> None:
    assert params_file.check(changed(f"agents.{'a' * 60}", RANDOM))
    line = refusal(changed(f"agents.{'a' * 61}", RANDOM))
    assert line.endswith("..., allowed: at most 60 characters")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("-S seeds=[1", "no viable alternative at input '[1'"),
        ("-S +seeds.x=1", "Error merging override +seeds.x=1"),
        ("-S seeds.x=1", "invalid literal for int"),
        ("--single-item -S seeds=[1]", "LexerNoViableAltException: --single-item"),
        ("-S agents.dqn.gama=0.5", "Could not override 'agents.dqn.gama'."),
    ],
)
def test_presets_are_nothing_but_overrides(tmp_path: Path, text: str, said: str) -> None:
    shutil.copy(PROJECT_ROOT / "params.yaml", tmp_path)
    (tmp_path / "presets").mkdir()
    (tmp_path / "presets" / "mine").write_text(text, encoding="utf-8")
    told = f"presets/mine: not overrides of params.yaml: {said}"
    with pytest.raises(InputError, match=re.escape(told)):
        presets.load("mine", tmp_path)


def test_presets_need_dvc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dvc.utils.hydra", None)
    with pytest.raises(InputError, match="install the package's extra `track`"):
        presets.load("smoke")


@pytest.mark.parametrize("name", sorted(model.RESERVED_NAMES))
def test_names_of_other_files_are_no_agents(name: str) -> None:
    line = refusal(changed(f"agents.{name}", RANDOM))
    assert line == f"params.yaml: agents: {name!r} names a file of media/; allowed: any other"


def test_agents_may_be_called_as_pydantic_calls_its_types() -> None:
    content = changed("agents.float-literal", RANDOM | {"gamma": 1})
    assert refusal(content).startswith("params.yaml: agents.float-literal.gamma: unknown key")


def test_all_faults_are_told_at_once() -> None:
    content = changed("robot.density", 0)
    content["env"]["frame_skip"] = "x"
    content["agents"]["sac"]["ent_coef"] = 0
    keys = [line.split(": ")[1] for line in refusal(content).splitlines()]
    assert keys == ["robot.density", "env.frame_skip", "agents.sac.ent_coef"]


def test_an_unknown_agent_is_answered_with_those_there_are() -> None:
    checked = params_file.check(changed("agents", {"a": RANDOM, "b-2": RANDOM}))
    with pytest.raises(InputError, match=r"agent: given 'c', allowed: a, b-2$"):
        checked.agent("c")
    assert checked.agent("a") is checked.agents["a"]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "No such file or directory"),
        (b"seeds: [1", "not YAML: while parsing a flow sequence"),
        (b"seeds: [1]\nseeds: [2]", 'found duplicate key "seeds"'),
        (b"seeds: !!python/object/apply:os.getcwd []", "not YAML: could not determine"),
        (b"seeds: 2024-13-45", "not YAML: month must be in 1..12"),
        (b"\xff\xfe\x00", "not YAML: 'utf-8' codec can't decode byte 0xff"),
        (b"[" * 500, "not YAML: maximum recursion depth"),
        (b"seeds: &a [*a]", "not YAML: maximum recursion depth"),
        (LAUGHS, "given 2.35e+09 values, allowed: 100,000; each alias of an anchor counts as"),
        (b"", "the file: given None, allowed: a block of keys"),
        (b"- 1", "the file: given [1], allowed: a block of keys"),
    ],
)
def test_files_that_hold_no_parameters(tmp_path: Path, content: bytes | None, said: str) -> None:
    path = tmp_path / "mine.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        params_file.load(path)
    assert str(caught.value).startswith("mine.yaml: ")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("text", "value"), [("3e-4", 3e-4), ("010", 10.0), ("yes", None)])
def test_scalars_are_those_of_yaml_1_2(tmp_path: Path, text: str, value: float | None) -> None:
    path = tmp_path / "params.yaml"
    real = (PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8")
    path.write_text(re.sub(r"density: [0-9.]+", f"density: {text}", real), encoding="utf-8")
    if value is None:
        with pytest.raises(InputError, match="robot.density: given"):
            params_file.load(path)
    else:
        assert params_file.load(path).robot.density == value


def leaves(content: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return where something stands: every block, every list, every value."""
    inner = content.items() if isinstance(content, dict) else ()
    inner = enumerate(content) if isinstance(content, list) else inner
    return [path, *(place for key, part in inner for place in leaves(part, (*path, key)))]


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.dates(),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=5) | st.integers() | st.none(), inner, max_size=3)
    ),
    max_leaves=5,
)


@settings(deadline=None)
@given(place=st.sampled_from(leaves(CONTENT)), value=VALUES)
def test_whatever_stands_there_is_accepted_or_refused(place: tuple[Any, ...], value: Any) -> None:
    content = {"file": copy.deepcopy(CONTENT)}
    block: Any = content
    for key in ("file", *place)[:-1]:
        block = block[key]
    block[("file", *place)[-1]] = value
    try:
        assert isinstance(params_file.check(content["file"]), model.Params)
    except InputError as error:
        assert all(line.startswith("params.yaml: ") for line in str(error).splitlines())

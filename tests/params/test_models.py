"""`params.yaml`: what is wrong is refused in one line a fault, all at once, whatever it is."""

import re
import shutil
import time
from pathlib import Path
from typing import Any

import pytest
from changed_params import CONTENT, MISSING, changed, refusal

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.params import params_file, presets

RANDOM = CONTENT["agents"]["random"]
DQN, SAC = CONTENT["agents"]["dqn"], CONTENT["agents"]["sac"] | {"learning_starts": 200}
# Nine lines of ten aliases each: billions of values in half a kilobyte.
LAUGHS = b"a0: &a0 [0]\n" + b"".join(
    f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]\n".encode() for n in range(1, 10)
)


def test_the_real_file_is_accepted_with_its_numbers() -> None:
    assert params_file.load().model_dump(exclude_unset=True) == CONTENT


@pytest.mark.parametrize(
    ("key", "value", "line"),
    [
        ("env.xyz", 5, "env: unknown key 'xyz', allowed: frame_skip, reset_noise_scale, drop"),
        ("agents.sac.actions.hod", 1, "agents.sac.actions: unknown key 'hod' (did you mean 'hold"),
        ("agents.random.a\nb", 1, "agents.random: unknown key 'a\\nb', allowed: algorithm, robot"),
        ("compare", MISSING, "compare: Field required"),
        ("env.frame_skip", "5", "env.frame_skip: Input should be a valid integer, given '5'"),
        ("robot.joint_gear", {"ankle": -1}, "robot.joint_gear.ankle: Input should be greater than"),
        ("robot.joint_gear", {-1: 1.0}, "robot.joint_gear.-1: Input should be a valid string, giv"),
        ("robot.source", "robots/../x.xml", "robot.source: given 'robots/../x.xml', allowed: ant,"),
        ("robot.friction", [0.6], "robot.friction: List should have at least 3 items"),
        ("env.commands", [[0.0], [0.0, 1.0]], "env.commands: given rows of 1 and of 2 torques, al"),
        ("agents.dqn.algorithm", "sarsa", "agents.dqn.algorithm: Input tag 'sarsa' found"),
        ("agents.dqn.algorithm", MISSING, "agents.dqn.algorithm: Unable to extract"),
        ("agents.dqn.actions.kind", "torques", "agents.dqn.actions.kind: Input should be 'command"),
        ("agents.sac.ent_coef", "often", "agents.sac.ent_coef.literal['auto']: Input should be 'a"),
        ("agents.pgpe.actions.levels", 2, "agents.pgpe.actions: levels is 2, but kind torques ta"),
        ("agents.Big One", RANDOM, "agents.Big One: String should match pattern"),
        ("agents./etc", RANDOM, "agents./etc: String should match pattern"),
        (f"agents.{'a' * 61}", RANDOM, f"agents.{'a' * 61}: String should have at most 60 charac"),
        ("agents.lineup", RANDOM, "agents: 'lineup' names something else; allowed: any other"),
        ("agents.you", RANDOM, "agents: 'you' names something else; allowed: any other"),
        # Agents may be called as pydantic calls its types.
        ("agents.float-literal", RANDOM | {"gamma": 1}, "agents.float-literal: unknown key 'gamm"),
        ("seeds", [4, 5, 4], "seeds: given 4 more than once, allowed: each seed once"),
        ("seeds", [3, 7_000_001], "seeds: given 7000001, allowed: none of 7000000 to 7999999, on"),
        (
            "agents.sac",
            SAC | {"total_steps": 600},
            "agents.sac: total_steps is 600, but learning_st",
        ),
        (
            "evaluate.baseline_episodes",
            33,
            "evaluate: baseline_episodes: given 33, allowed: at mos",
        ),
    ],
)
def test_a_fault_is_a_line_with_the_key(key: str, value: Any, line: str) -> None:
    first = refusal(changed(key, value)).splitlines()
    assert any(one.startswith(f"params.yaml: {line}") for one in first), first


def test_faults_of_several_blocks_are_reported_at_once() -> None:
    content = changed("robot.density", 0)
    content["env"]["frame_skip"] = "x"
    content["agents"]["sac"]["gamma"] = 2
    keys = [line.split(": ")[1] for line in refusal(content).splitlines()]
    assert keys == ["robot.density", "env.frame_skip", "agents.sac.gamma"]


def test_too_many_seeds_are_refused_at_once(tmp_path: Path) -> None:
    started = time.perf_counter()
    line = refusal(changed("seeds", list(range(10**6))))
    assert line.startswith("params.yaml: seeds: List should have at most 1000 items")
    path = tmp_path / "params.yaml"
    path.write_text(f"seeds: {list(range(10**6))}\n", encoding="utf-8")
    with pytest.raises(InputError, match="params.yaml: given more, allowed: 200,000 characters"):
        params_file.load(path)
    assert time.perf_counter() - started < 10  # it took a minute


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("-S seeds=[1", "no viable alternative at input '[1'"),
        ("-S seeds.x=1", "invalid literal for int"),
        ("-S agents.dqn.gama=0.5", "Could not override 'agents.dqn.gama'."),
        ("-S seeds=range(0,1000000000)", "given 'seeds=range(0,1000000000)', allowed: values"),
        ("-S env.reward=${oc.env:HOME}", "given 'env.reward=${oc.env:HOME}', allowed: values"),
        (
            r"-S env.reward=$\{oc.env:HOME}",
            "given 'env.reward=$\\\\{oc.env:HOME}', allowed: values",
        ),
        (f"-S seeds={'[' * 5000}", ""),
        (f"-S seeds={list(range(60_000))}", "given 408,899 characters, allowed: 20,000"),
    ],
)
def test_presets_are_nothing_but_overrides(tmp_path: Path, text: str, said: str) -> None:
    shutil.copy(PROJECT_ROOT / "params.yaml", tmp_path)
    (tmp_path / "presets").mkdir()
    (tmp_path / "presets" / "mine").write_text(text, encoding="utf-8")
    line = f"presets/mine: not overrides of params.yaml: {said}"
    with pytest.raises(InputError, match=re.escape(line)):
        presets.load("mine", tmp_path)


def test_presets_read_no_variables_for_a_params_file(tmp_path: Path) -> None:
    """DVC would resolve references in it, and read it whatever it holds."""
    write_text(tmp_path / "presets" / "mine", "-S seeds=[1]")
    for more in ("zz: ${oc.env:HOME}", "a: &a {<<: {b: 1}}"):
        text = (PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8")
        write_text(tmp_path / "params.yaml", f"{text}\n{more}\n")
        with pytest.raises(
            InputError, match=r"params.yaml: (given a reference|not YAML: merge ke)"
        ):
            presets.load("mine", tmp_path)


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
        (LAUGHS, "given 2.35e+09 values, aliases counted as what their anchors hold"),
        (b"0x" + b"f" * 5000, "instance of Params, given a number too long to show"),
        (b"", "the file: Input should be a valid dictionary or instance of Params, given None"),
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


@pytest.mark.parametrize(("text", "value"), [("3e-4", 3e-4), ("010", 10.0)])
def test_scalars_are_those_of_yaml_1_2(tmp_path: Path, text: str, value: float) -> None:
    path = tmp_path / "params.yaml"
    real = (PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8")
    path.write_text(re.sub(r"density: [0-9.]+", f"density: {text}", real), encoding="utf-8")
    assert params_file.load(path).robot.density == value

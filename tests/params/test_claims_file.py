"""Claims as files: `claims/NAME.yaml`, chosen in `params.yaml`."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import pytest

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.comparison import claims as judged
from jumping_ant.evaluation.episodes import PUBLISHED, VARIANTS
from jumping_ant.params import claims, params_file, presets
from jumping_ant.params.model import Params

ROW = "{text: A., measure: return, agent: sac, against: dqn}"


@pytest.fixture
def params() -> Params:
    return params_file.load()


@pytest.fixture
def project(tmp_path: Path) -> Path:
    shutil.copytree(PROJECT_ROOT / "presets", tmp_path / "presets")
    return tmp_path


def write(root: Path, text: str) -> None:
    write_text(root / "claims" / "default.yaml", text)


@pytest.mark.parametrize("name", sorted(path.name for path in (PROJECT_ROOT / "presets").iterdir()))
def test_every_preset_chooses_claims_that_fit(name: str) -> None:
    claims.of_project(PROJECT_ROOT, presets.load(name))


def test_the_default_asks_all_its_claims_of_agents_and_versions_that_it_has(params: Params) -> None:
    asked = claims.of_project(PROJECT_ROOT, params)
    for claim in asked:
        for whom in (claim.agent, claim.against):
            name, _, version = whom.partition("/")
            assert name in params.agents and version in ("", *VARIANTS)
    assert len({claim.text for claim in asked}) == len(asked)


def test_every_measure_has_an_axis() -> None:
    assert list(judged.AXES) == list(get_args(claims.Measure))
    assert PUBLISHED not in VARIANTS


def test_a_project_may_claim_nothing(project: Path, params: Params) -> None:
    assert claims.of_project(project, params.model_copy(update={"claims": "none"})) == []
    write(project, "[]\n")
    assert claims.of_project(project, params) == []


def test_agents_of_presets_are_known(project: Path, params: Params) -> None:
    write(project, f"- {ROW.replace('dqn', 'cmaes/final')}\n")
    (claim,) = claims.of_project(project, params)
    assert (claim.against, claim.side, claim.margin) == ("cmaes/final", "more", None)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda row: row.replace("dqn", "dqm"), r"0.against: given 'dqm', allowed: a2c, .*dqn, "),
        (lambda row: row.replace("return", "retrun"), "default.yaml: 0.measure"),
        (lambda row: row.replace("return", "[return]"), "default.yaml: 0.measure"),
        (lambda row: row.replace("agent", "agents"), "unknown key 'agents' .did you mean 'agent'"),
        (lambda row: row.replace("}", ", margin: -1}"), "0.margin: .*greater than 0.*given -1"),
        (lambda row: row.replace("}", ", margin: nan}"), "0.margin"),
        (lambda row: row.replace("}", ", side: same}"), "0.side: .*'more' or 'less', given 'same'"),
        (lambda row: row.replace("sac", "sac/../x"), "0.agent"),
        (lambda row: row.replace(", against: dqn", ""), "0.against: Field required"),
        (lambda row: "7", "0: .*given 7"),
        (lambda row: "{" * 3000, "default.yaml: not YAML"),
    ],
)
def test_what_does_not_fit_is_refused(
    project: Path, params: Params, change: Callable[[str], Any], told: str
) -> None:
    write(project, f"- {change(ROW)}\n")
    with pytest.raises(InputError, match=told):
        claims.of_project(project, params)


def test_a_file_that_is_not_there_is_refused(project: Path, params: Params) -> None:
    write(project, "[]\n")
    with pytest.raises(InputError, match="claims: given 'mine', allowed: none, default"):
        claims.of_project(project, params.model_copy(update={"claims": "mine"}))

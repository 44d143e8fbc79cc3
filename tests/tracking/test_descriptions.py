"""Descriptions in MLflow: tables of results, claims, origins."""

from jumping_ant.tracking import descriptions

INTERVAL = {"iqm": 1234.5, "low": 0.001234, "high": 2345678.0}
CLAIM = {"text": "A leads", "verdict": "refuted", "evidence": "p = 0"}


def test_a_comparison_is_a_table_the_best_first_and_its_claims() -> None:
    agents = {
        "a": {"seeds": 2, "return": {"iqm": 1.0, "low": 0.0, "high": 2.0}, "train_seconds": 40},
        "b": {"seeds": 2, "return": INTERVAL},
        "c": {"seeds": 2},
    }
    text = descriptions.comparison({"agents": agents, "claims": [CLAIM]})
    rows = [line.replace(descriptions.HARD_SPACE, " ") for line in text.splitlines()]
    assert (
        rows[0] == "| agent   | return   | peak height [m]   | torque change   | training [s]   |"
    )
    assert rows[1] == "|---|---|---|---|---|"
    assert rows[2] == "| b   | 1,234 [0.00123, 2,345,678]   | –   | –   | –   |"
    assert rows[3] == "| a   | 1 [0, 2]   | –   | –   | 40   |"
    assert rows[4] == "| c   | –   | –   | –   | –   |"
    assert rows[-1] == "- **refuted**: A leads (p = 0)"


def test_nothing_compared_has_no_description() -> None:
    assert descriptions.comparison({}) == ""


def test_what_mlflow_would_cut_off_ends_with_a_whole_line() -> None:
    text = descriptions.comparison({"claims": [CLAIM] * 1000})
    assert len(text) < 8000
    assert text.splitlines()[-2:] == ["", "(The rest is in `comparison.json`.)"]


def test_a_policy_that_is_not_evaluated_is_told_so() -> None:
    assert descriptions.policy("sac", 3, {}, {"git commit": "abc"}) == (
        "sac, training seed 3: not evaluated.\n\n- git commit: `abc`"
    )

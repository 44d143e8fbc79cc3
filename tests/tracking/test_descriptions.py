"""Descriptions in MLflow: tables of results, claims, origins."""

from jumping_ant.tracking import descriptions

INTERVAL = {"iqm": 1234.5, "low": 0.001234, "high": 2345678.0, "mean": 1300.0, "worst": -4.0}
CLAIM = {"text": "A leads", "verdict": "refuted", "p_adjusted": 0.01234}


def test_a_comparison_is_a_table_the_best_first_and_its_claims() -> None:
    agents = {
        "a": {
            "seeds": 2,
            "return": {"iqm": 1.0, "low": 0.0, "high": 2.0},
            "train_seconds": 40,
            "fluidity": {"iqm": -2.0, "low": -3.0, "high": -1.0},
        },
        "b": {"seeds": 2, "return": INTERVAL},
        "c": {"seeds": 2},
    }
    text = descriptions.comparison({"agents": agents, "claims": [CLAIM]})
    rows = [line.replace(descriptions.HARD_SPACE, " ") for line in text.splitlines()]
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert cells[0] == [
        "agent", "return", "mean", "worst seed", "apex [m]", "flight", "fluidity", "training [s]",
    ]  # fmt: skip
    assert cells[1] == ["---"] * 8
    assert cells[2] == ["b", "1,234 [0.00123, 2,345,678]", "1,300", "-4", *"––––"]
    assert cells[3] == ["a", "1 [0, 2]", "–", "–", "–", "–", "-2 [-3, -1]", "40"]
    assert cells[4] == ["c", *"–––––––"]
    assert rows[-1] == "- **refuted** (adjusted p = 0.012): A leads"


def test_nothing_compared_has_no_description() -> None:
    assert descriptions.comparison({}) == ""


def test_what_mlflow_would_cut_off_ends_with_a_whole_line() -> None:
    text = descriptions.comparison({"claims": [CLAIM] * 1000})
    assert len(text) < 8000
    assert text.splitlines()[-2:] == ["", "(The rest is in `comparison.json` and `speed.json`.)"]


def test_a_policy_that_is_not_evaluated_is_told_so() -> None:
    assert descriptions.policy("sac", 3, 2, {}, {"git commit": "abc"}) == (
        "sac, training seed 3: not evaluated. Each output is held for 2 control steps.\n\n"
        "- git commit: `abc`"
    )

"""Results in the documents."""

import io
import subprocess
import sys
from pathlib import Path

import committed
import imageio.v3 as iio
import numpy as np
import pytest
from PIL import Image

from jumping_ant.base.errors import InputError
from jumping_ant.base.files import write_text
from jumping_ant.base.paths import Paths
from jumping_ant.params import params_file
from jumping_ant.training import curves
from scripts import animation, markdown, publish

CLAIM = {"text": "A leads", "verdict": "refuted", "p_adjusted": 0.01234}
SEEDS = list(params_file.load().seeds)
NOT_JUDGED = ("before", "after", "difference", "low", "high", "p")
TEXT = "Above.\n\n<!-- part -->\nold\nlines\n<!-- end of part -->\n\nBelow.\n"


def test_a_section_is_replaced_between_its_marks(tmp_path: Path) -> None:
    path = tmp_path / "results.md"
    path.write_text(TEXT, encoding="utf-8")
    publish.replace_section(path, "part", "new\n")
    assert path.read_text(encoding="utf-8") == TEXT.replace("old\nlines", "new")
    with pytest.raises(InputError, match="given no <!-- other --> ... <!-- end of other"):
        publish.replace_section(path, "other", "new\n")


def test_results_that_are_not_there_are_named_with_what_makes_them(tmp_path: Path) -> None:
    message = r"comparison.json: No such file or directory; run `dvc repro report`"
    with pytest.raises(InputError, match=message):
        publish.results(tmp_path)


AGREE = """
from scripts import markdown, publish

sections = publish.committed_sections()
for (document, name), content in sections.items():
    text = document.read_text(encoding="utf-8")
    assert markdown.replaced(document, text, name, content) == text, (document.name, name)
print(*sorted({document.name for document, _ in sections}))
"""


def test_the_documents_agree_with_the_results(tmp_path: Path) -> None:
    """`make publish` and its presets write these; nobody types them."""
    committed.extract(tmp_path)
    printed = subprocess.run(
        [sys.executable, "-c", AGREE], cwd=tmp_path, stdout=subprocess.PIPE, encoding="utf-8"
    ).stdout
    assert printed.split() == [
        *("README.md", "article.md", "measures-and-claims.md", "results.md", "tables.md")
    ]


def test_what_agents_keep_stands_in_per_cent() -> None:
    kept, none = {"retention": [0.9, 0.256]}, {"retention": [None]}
    agents = {"sac": {"torso_mass": kept, "push": kept}, "beat": {"torso_mass": none, "push": kept}}
    table = markdown.kept_table({"perturbations": ["torso_mass", "push"], "agents": agents})
    assert table.splitlines()[2:] == ["| torso mass | 26 | – |", "| push | 26 | 26 |"]


def test_searches_stand_beside_their_controls() -> None:
    best = {"1": 5000.0, "7": 6500.0}
    search = {"agent": "sac", "trials": 40, "seeds_per_trial": 2, "pruned": 15, "best_after": best}
    search |= {"rules": {"ranges": {"gamma": {"low": 0.9, "high": 0.99}}, "seeds": 2}}
    judged = {"before": 7000.0, "after": 7600.0, "verdict": "better", "p": 0.00312}
    judged |= {"difference": 590.0, "low": 200.0, "high": 900.0}
    control = search | {"draws": [], "expected_best": {"1": 3000.0, "7": 6000.0}}
    unchanged = search | {"agent": "td3", "verdict": "unchanged"} | dict.fromkeys(NOT_JUDGED)
    table = markdown.tuning_table([search | judged, control, unchanged])
    assert table.splitlines()[2:] == [
        "| sac | 40 x 2 | 15 | 7,000 | 7,600 | 590 [200, 900] | better | 0.0031 | 5,000, 6,500 | "
        "3,000, 6,000 |",
        "| td3 | 40 x 2 | 15 |  |  |  | unchanged |  | 5,000, 6,500 |  |",
    ]


@pytest.fixture
def validated(tmp_path: Path) -> Path:
    """A project in which eight seeds of SAC were validated at 100,000 and 200,000 control steps."""
    text = (publish.PROJECT_ROOT / "params.yaml").read_text(encoding="utf-8")
    text = text.replace("total_steps: 54000 ", "total_steps: 200000 ")
    text = text.replace(f"seeds: {SEEDS}", f"seeds: {SEEDS[:8]}")
    (tmp_path / "params.yaml").write_text(text, encoding="utf-8")
    for number, seed in enumerate(SEEDS[:8]):
        write_curve(tmp_path, seed, ("50000", ""), ("100000", number), ("200000", 100 * number))
    return tmp_path


def write_curve(root: Path, seed: int, *rows: tuple[str, object]) -> None:
    """Write control steps and returns in validation, where there are any."""
    lines = [",".join(["agent", "seed", *curves.COLUMNS])]
    lines += [f"sac,{seed},{steps},,,,,{value}," for steps, value in rows]
    write_text(Paths(root).agent("sac").seed(seed).curve, "\n".join([*lines, ""]))


def test_returns_stand_beside_published_ones(validated: Path) -> None:
    rows = markdown.published_table(validated).splitlines()[2:]
    assert rows[0].startswith("| 100,000 | **4** (0, 1, 2, 3, 4, 5, 6, 7) | **533** (357, 359, ")
    assert rows[1].startswith("| 200,000 | **350** (0, 100, ")
    assert rows[1].endswith(", 2,256) |")
    write_curve(validated, SEEDS[0], ("100000", 1), ("200010", 2))
    with pytest.raises(InputError, match="given no validation at 200,000 control steps"):
        markdown.published_table(validated)


def test_the_learners_films_play_side_by_side(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Films as grey as their second, each agent's a little lighter than the one before."""
    agents = params_file.load().agents
    learners = [name for name, agent in agents.items() if not agent.is_baseline]
    (tmp_path / "media").mkdir()
    for number, name in enumerate(learners):
        seconds = np.arange(10, dtype=np.uint8)[:, None, None, None]
        film = np.broadcast_to(20 * seconds + 10 * number, (10, 64, 64, 3))
        iio.imwrite(tmp_path / "media" / f"{name}.mp4", film, fps=1)
    monkeypatch.setattr(animation, "PROJECT_ROOT", tmp_path)
    monkeypatch.setattr(animation, "SECONDS", 2.0)
    picture = Image.open(io.BytesIO(animation.picture()))
    assert picture.size == (300 * len(learners), 300)
    for frame, second in enumerate((7, 8, 9)):  # equal pictures in a row are one
        picture.seek(frame)
        greys = np.asarray(picture.convert("L"))[200, 150::300]
        assert np.abs(greys - (20.0 * second + 10 * np.arange(len(learners)))).max() < 4

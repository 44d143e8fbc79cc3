"""Write the live page, in which the trained robots run in MuJoCo's WebAssembly build.

Usage: python -m stages.play
Reads: params.yaml; the robots in assets/, models/, results/agents/; the page's libraries,
    which `make install` fetched.
Writes: results/play.html.
"""

from jumping_ant.base.files import PROJECT_ROOT, write_text
from jumping_ant.play import page

from . import parse, run


def main() -> None:
    """Run the stage."""
    settings = parse(__doc__)
    content = page.build(PROJECT_ROOT, settings)
    write_text(page.path(PROJECT_ROOT), content)


if __name__ == "__main__":
    run(main)

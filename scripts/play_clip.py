"""Film the live page, for README.md.

Usage: python -m scripts.play_clip
Reads: results/play.html.
Writes: docs/images/play.webp.
"""

import io

from PIL import Image
from playwright.sync_api import ViewportSize

from jumping_ant.base import command_line
from jumping_ant.base.errors import reported
from jumping_ant.base.files import PROJECT_ROOT, write_bytes
from jumping_ant.play import page
from scripts.parity import chromium

PATH = PROJECT_ROOT / "docs" / "images" / "play.webp"
STATE = "#a=sac.45.0&b=metronome.30.0&run=0"
STEPS = 70  # control steps of 0.05 s
SIZE: ViewportSize = {"width": 900, "height": 600}


def main() -> None:
    """Film the picture, step by step."""
    command_line.parser(__doc__).parse_args()
    frames = []
    with chromium(page.path(PROJECT_ROOT).as_uri()) as opened:
        opened.set_viewport_size(SIZE)
        opened.evaluate(f"location.hash = '{STATE}'")
        opened.wait_for_function("page.frames.every((own) => own?.steps === 0)")
        for number in range(1, STEPS + 1):
            opened.evaluate("page.step()")
            opened.wait_for_function(f"page.frames.every((own) => own.steps === {number})")
            opened.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
            frames.append(Image.open(io.BytesIO(opened.locator("#stage").screenshot())))
    buffer = io.BytesIO()
    small = [
        own.convert("RGB").resize((640, round(640 * own.height / own.width))) for own in frames
    ]
    small[0].save(
        buffer, "WEBP", save_all=True, append_images=small[1:], duration=50, loop=0, quality=60
    )
    write_bytes(PATH, buffer.getvalue())


if __name__ == "__main__":
    with reported():
        main()

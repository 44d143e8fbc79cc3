"""A headless browser that notes what the pages it opens ask for and complain about."""

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import pytest
from playwright.sync_api import Browser, ConsoleMessage, Page, Request, expect, sync_playwright

SECONDS = 120.0  # before a page has failed: other tests run beside this one, perhaps slowly
# Beside other tests, drawing may take longer than the watchdog of Chromium's GPU process allows.
ARGUMENTS = ["--no-sandbox", "--disable-gpu-watchdog"]
expect.set_options(timeout=1000 * SECONDS)


@dataclass
class Visit:
    """A page, what it asked for, and its complaints."""

    page: Page
    requests: list[str] = field(default_factory=list)  # but `data:` and `blob:`
    console_errors: list[str] = field(default_factory=list)
    page_errors: list[str] = field(default_factory=list)  # exceptions that nothing caught

    def note_all(self) -> None:
        """Take note from now on."""
        self.page.on("request", self._note_request)
        self.page.on("pageerror", lambda error: self.page_errors.append(str(error)))
        self.page.on("console", self._note_message)

    def wait_for(self, condition: str, seconds: float = SECONDS) -> None:
        """Wait until an expression is true, even on a page whose policy forbids `eval`."""
        deadline = time.monotonic() + seconds
        while not self.page.evaluate(condition):
            seen = (condition, self.console_errors, self.page_errors)
            assert time.monotonic() < deadline, seen
            self.page.wait_for_timeout(10)

    def _note_request(self, request: Request) -> None:
        if not request.url.startswith(("data:", "blob:")):
            self.requests.append(request.url)

    def _note_message(self, message: ConsoleMessage) -> None:
        if message.type == "error":
            self.console_errors.append(message.text)


OpenPage = Callable[..., Visit]


@contextmanager
def launched() -> Iterator[Browser]:
    """Run Debian's Chromium; where it is missing and can't be installed, tests are skipped."""
    path = shutil.which("chromium")
    if not path:
        pytest.skip("no chromium here; run `scripts/environment.sh browser`")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        try:
            yield browser
        finally:
            browser.close()


def open_page(browser: Browser, address: str, width: int = 1600, height: int = 1000) -> Visit:
    """Open an address in a window that remembers nothing of others."""
    visit = Visit(browser.new_page(viewport={"width": width, "height": height}))
    visit.page.context.set_default_timeout(1000 * SECONDS)  # of pages that it opens, too
    visit.note_all()
    visit.page.goto(address)
    return visit

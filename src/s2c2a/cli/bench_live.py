"""`s2c2a bench-live`: what the live page must show, measured on this machine."""

from pathlib import Path

from s2c2a.cli.console import Arm, print_table
from s2c2a.cli.crews import require
from s2c2a.cli.live import running_page


def bench_live(arm: Arm = "twin_arm", minutes: float = 10.0, browsers: bool = True) -> None:
    """Measure the live page: start, control steps while browsers watch, drags, a long run, a flood.

    Args:
        arm: a preset, or an arm file with networks of its own in the package.
        minutes: of random drags.
        browsers: whether to open headless ones; needs Chromium and `playwright`.
    """
    require("live", "viser", "websockets", "msgspec")
    from s2c2a.live import measuring

    figures = []
    if browsers:
        with headless() as browser:
            measuring.start_time(browser, arm, 8190)  # the first one compiles
            figures.append(measuring.start_time(browser, arm, 8190))
    with running_page(arm, out=Path("runs"), port=8191) as (loop, page):
        figures.append(measuring.dragged(loop))
        figures += measuring.read_along(loop, page)
        if browsers:
            with headless() as browser:
                figures += measuring.watched(loop, page, browser)
        figures += measuring.flooded(loop, page)
        figures += measuring.lasting(loop, minutes)
    print_table(f"the live page of {arm}", ("what", "asked", "found"), [tuple(figure) for figure in figures])


def headless():
    """A headless Chromium, as a context; it draws in software.

    Raises:
        S2C2AError: there is none.
    """
    import shutil
    from contextlib import contextmanager

    from s2c2a.errors import S2C2AError
    from s2c2a.live.measuring import FLAGS

    require("dev", "playwright")
    path = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if path is None:
        raise S2C2AError("no Chromium here; install it (`apt install chromium`), or say --no-browsers")
    from playwright.sync_api import sync_playwright

    @contextmanager
    def opened():
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
            yield browser
            browser.close()

    return opened()

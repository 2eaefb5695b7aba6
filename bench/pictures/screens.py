"""The report as a browser shows it, at a desk and on a phone."""

import shutil
from pathlib import Path
from typing import Literal

from companion.errors import ReboundError

NAMES = ("chromium", "chromium-browser", "google-chrome")
# Three dimensions without a graphics card, and a browser that asks its maker for nothing. As root there is no sandbox.
ARGUMENTS = (
    *("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--disable-quic"),
)
# Of each picture the window's width and height, CSS pixels, and whether a dark page is wished for.
SCREENS = {"report.png": (1280, 1000, False), "report-phone.png": (390, 844, True)}


class NoBrowserError(ReboundError):
    """No browser is installed."""


def browser_path() -> str:
    """Raises NoBrowserError."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        raise NoBrowserError("No browser is installed: apt-get install chromium (on Ubuntu: chromium-browser).")
    return found


def write_screens(page: Path, folder: Path) -> None:
    """Each of SCREENS, of the hit at which the page opens. Raises NoBrowserError."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)
        for name, (width, height, is_dark) in SCREENS.items():
            colours: Literal["dark", "light"] = "dark" if is_dark else "light"
            opened = browser.new_page(viewport={"width": width, "height": height}, color_scheme=colours)
            opened.goto(page.resolve().as_uri())
            opened.screenshot(path=folder / name)

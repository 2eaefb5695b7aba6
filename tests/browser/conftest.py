"""One recorded flight and one browser for all tests here."""

from contextlib import contextmanager

import pytest
from playwright.sync_api import sync_playwright

from bench.pictures import ARGUMENTS, NoBrowserError, browser_path
from rebound_cli.report.page import write_page
from tests.browser.opened_page import OpenedPage
from tests.rebound_cli.conftest import wall, wall_flight, wall_folder  # noqa: F401


def pytest_sessionstart():
    try:
        browser_path()
    except NoBrowserError as error:
        pytest.exit(str(error), returncode=1)


@pytest.fixture(scope="session")
def browser():
    with sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=browser_path(), args=ARGUMENTS)


@pytest.fixture(scope="session")
def file(wall, tmp_path_factory):  # noqa: F811
    return write_page(wall, tmp_path_factory.mktemp("page") / "flight.html")


@pytest.fixture
def opened(browser):
    @contextmanager
    def opening(address, width=1280, height=900, **options):
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        try:
            yield OpenedPage(context.new_page(), address)
        finally:
            context.close()

    return opening


@pytest.fixture(params=[390, 1280], ids=["phone", "desktop"])
def shown(request, opened, file):
    """The flight's page, as wide as a phone and as a desktop's window."""
    with opened(file.as_uri(), request.param) as page:
        yield page

"""One service and one browser for all tests of the page.

Gone when the tests of this folder are: Playwright keeps an event loop running, which others must not find.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, BrowserContext, Playwright, sync_playwright

from support.browser import CHROMIUM, SIZE, Proxy, launch, patient
from support.service_process import Page as Watcher
from support.service_process import Service, add_users


@pytest.fixture(scope="package")
def page_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    if sys.platform != "linux":
        pytest.skip("the service needs Linux")
    root = tmp_path_factory.mktemp("page")
    add_users(root)
    with Service(root) as service:
        yield service


@pytest.fixture(scope="package")
def playwright() -> Iterator[Playwright]:
    if not Path(CHROMIUM).exists():
        pytest.skip(f"{CHROMIUM} is missing: Debian package chromium")
    with sync_playwright() as made:
        yield made


@pytest.fixture(scope="package")
def proxy(page_service: Service) -> Iterator[Proxy]:
    made = Proxy(int(page_service.address.rsplit(":", 1)[1]))
    yield made
    made.close()


@pytest.fixture(scope="package")
def browser(playwright: Playwright, page_service: Service, proxy: Proxy) -> Iterator[Browser]:
    with launch(playwright, page_service, proxy) as made:
        yield made


@pytest.fixture
def watcher(page_service: Service) -> Iterator[Watcher]:
    """Somebody who looks on past the proxy, and leaves the axis at rest and free."""
    with page_service.page("viewer", queue=None) as made:
        yield made
        made.do("stop")
        made.until(lambda tags: tags["at_rest"] and not tags["authority_user"])


@pytest.fixture
def context(browser: Browser, watcher: Watcher) -> Iterator[BrowserContext]:
    """Closed before the watcher waits for the axis to be free."""
    made = patient(browser.new_context(viewport=SIZE, locale="en-GB"))
    yield made
    made.close()

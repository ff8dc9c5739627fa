"""One browser for all tests of a process; where the system has none, they are skipped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.browser import pages
from tests.browser.chromium import Browser, found
from tests.cli.conftest import call  # noqa: F401  # a fixture

Check = Callable[..., None]


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """A headless Chromium."""
    program = found()
    if program is None:
        pytest.skip("no Chromium on this system; `make browser` installs it where it may (Debian, as root)")
    opened = Browser(program, tmp_path_factory.mktemp("chromium"))
    yield opened
    opened.close()


@pytest.fixture
def right(request: pytest.FixtureRequest) -> Check:
    """Check that pages open without fault; asked for last, so that a journey runs where there is no browser too."""

    def check(*written: Path) -> None:
        browser = request.getfixturevalue("browser")
        for page in written:
            assert pages.problems(browser, page) == [], page

    return check

"""What tests of the player share."""

import pytest

from browser import browsing


@pytest.fixture(scope="session")
def chromium(tmp_path_factory):
    """A browser for all tests."""
    with browsing(tmp_path_factory.mktemp("browser")) as one:
        yield one


@pytest.fixture
def browser(chromium):
    """The browser as it was when it started."""
    chromium.open("about:blank")
    chromium.resize(1280, 800)
    chromium.complaints()
    return chromium

"""What tests of the player share."""

import pytest

from browser import browsing


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with browsing(tmp_path_factory.mktemp("browser")) as one:
        yield one

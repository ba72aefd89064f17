"""Hooks of pytest that measure the processor time of each test and list the slowest ones.

The time of a test includes its fixtures and all processes that they start. Unlike wall time, it
hardly depends on other programs running at the same time.
"""

import contextlib
import os
from pathlib import Path

import pytest

from whole_runs import facts_of

#: Number of tests in the list.
SHOWN = int(os.environ.get("SLOWEST", "10"))
BEGAN = pytest.StashKey[float]()


def living_descendants() -> list[list[str]]:
    """Return data about all running descendants of this process."""
    facts, family = {}, {os.getpid()}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):  # the process has ended meanwhile
            facts[int(folder.name)] = facts_of(folder.name)
    grown = True
    while grown:
        children = {pid for pid, fields in facts.items() if int(fields[1]) in family}
        grown = not children <= family
        family |= children
    return [facts[pid] for pid in family - {os.getpid()}]


def has_children() -> bool:
    """Return whether a child process exists, which is quicker than examining all processes."""
    try:
        os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
    except ChildProcessError:
        return False
    return True


def processor_time() -> float:
    """Return the processor time of this process and all descendants, also ended ones [s]."""
    living = living_descendants() if has_children() else []
    ticks = sum(int(ticks) for fields in living for ticks in fields[11:15])
    return sum(os.times()[:4]) + ticks / os.sysconf("SC_CLK_TCK")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item):
    item.stash[BEGAN] = processor_time()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    made = yield
    if call.when == "teardown":
        used = processor_time() - item.stash[BEGAN]
        made.get_result().user_properties.append(("processor_time", used))


def slowest_tests(reports) -> list[str]:
    """Return the lines of the summary for the reports of all tests."""
    known = [(dict(report.user_properties).get("processor_time"), report.nodeid)
             for report in reports]  # fmt: skip
    times = sorted(((used, name) for used, name in known if used is not None), reverse=True)
    if len(times) <= 10:  # the developer runs only a few tests
        return []
    whole = sum(used for used, _ in times)
    title = f"slowest of {len(times)} tests, which used {whole:.0f} s of processor time:"
    return [title, *(f"{used:7.1f} s  {name}" for used, name in times[:SHOWN])]

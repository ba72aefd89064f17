"""Cases of the validation, and their verdicts: whether the measured values are acceptable."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ricochet.analysis.statistics import Estimate, SeriesMean


@dataclass(frozen=True)
class Member:
    """Run of the program, whose input may depend on the results of earlier runs."""

    text: str | Callable[..., str]
    after: tuple["Member", ...] = ()
    exit_codes: tuple[int, ...] = (0,)  # of a run that stops early, the .part file is read


class Tolerance(NamedTuple):
    """Allowed deviation of a measured value from its reference."""

    text: str
    # function of reference and standard error
    allowed: Callable[[np.ndarray, np.ndarray], np.ndarray]
    one_sided: int = 0  # +1: only larger values fail, -1: only smaller values fail


@dataclass(frozen=True)
class Case:
    """Case of the validation: one line in the tables of the report."""

    id: str
    what: str
    members: tuple[Member, ...]
    measure: Callable[..., ArrayLike | Estimate | SeriesMean]  # function of the runs of the members
    reference: ArrayLike
    tolerance: Tolerance
    source: str


class Verdict(NamedTuple):
    """Value of a case that is closest to its tolerance, and whether all values pass."""

    case: Case
    values: int
    reference: float
    measured: float
    error: float  # standard error, or 0
    used: float  # deviation over allowed deviation
    problem: str = ""

    @property
    def passed(self) -> bool:
        return not self.problem and self.used <= 1


def within(deviation: float) -> Tolerance:
    """Return an absolute tolerance."""
    return Tolerance(f"{deviation:g}", lambda ref, _: np.full_like(ref, deviation))


def relative(deviation: float) -> Tolerance:
    """Return a relative tolerance."""
    text = f"{100 * deviation:.3g} %" if deviation >= 1e-4 else f"{deviation:g} relative"
    return Tolerance(text, lambda ref, _: deviation * np.abs(ref))


def sigmas(count: float, deviation: float = np.inf) -> Tolerance:
    """Return a tolerance of `count` standard errors, but at most a relative deviation."""
    text = f"{count:g} sigma" + (f" and {100 * deviation:.3g} %" if deviation < np.inf else "")
    return Tolerance(text, lambda ref, error: np.minimum(count * error, deviation * np.abs(ref)))


EXACT = Tolerance("exact", lambda ref, _: np.zeros_like(ref))
AT_MOST = Tolerance("at most", lambda ref, _: np.zeros_like(ref), +1)
AT_LEAST = Tolerance("at least", lambda ref, _: np.zeros_like(ref), -1)


def judge(case: Case, runs: list) -> Verdict:
    """Measure a case; if an error occurs, only this case fails."""
    try:
        result = case.measure(*runs)
    except Exception as problem:
        return failed(case, f"{type(problem).__name__}: {problem}")
    mean, error = (
        (result.mean, result.error) if isinstance(result, Estimate | SeriesMean) else (result, 0.0)
    )
    measured = np.atleast_1d(np.asarray(mean, dtype=float))
    reference = np.atleast_1d(np.asarray(case.reference, dtype=float))
    if measured.shape != reference.shape and reference.size != 1:
        return failed(case, f"{measured.size} values instead of {reference.size}")
    reference = np.broadcast_to(reference, measured.shape).copy()
    error = np.broadcast_to(np.asarray(error, dtype=float), measured.shape)
    used = shares(case.tolerance, measured, reference, error)
    k = int(np.argmax(used))
    return Verdict(
        case, measured.size, reference[k], float(measured[k]), float(error[k]), float(used[k])
    )


def shares(
    tolerance: Tolerance, measured: np.ndarray, reference: np.ndarray, error: np.ndarray
) -> np.ndarray:
    """Return deviations over allowed deviations: inf if none is allowed, NaN for a value NaN."""
    same = measured == reference  # including infinite values
    with np.errstate(invalid="ignore", divide="ignore"):
        deviation = np.where(same, 0.0, measured - reference)
        deviation = deviation * tolerance.one_sided if tolerance.one_sided else np.abs(deviation)
        used = deviation / tolerance.allowed(reference, error)
    return np.where(deviation <= 0, 0.0, used)


def failed(case: Case, problem: str) -> Verdict:
    """Return the verdict of a case that could not be measured."""
    return Verdict(case, 0, np.nan, np.nan, np.nan, np.inf, problem)

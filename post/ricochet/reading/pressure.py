"""Mean pressure of a run between two times."""

import numpy as np

from .box import BoxResults
from .files import RunError
from .frames import Series
from .nature import TRAITS, allow


class PressureResults(BoxResults):
    """Results of one run, including its pressure."""

    def pressure(self, t1: float, t2: float) -> float:
        """Return the mean pressure between the samples closest in time to `t1` and `t2`.

        It is (<K> + dW / (2 dt)) / <A>, where K is the kinetic energy (relative to the mean flow in
        a sheared box), A the accessible area and dW the increase of the virial during the time dt.
        Averages use the trapezoidal rule. Between walls the result is smaller than the force per
        length on a wall: for equal disks of radius r in a square of side L, by the factor 1 - 2
        r / L.

        Parameters
        ----------
        t1, t2 : float
            times

        Returns
        -------
        float
            pressure [energy/length^2]

        Raises
        ------
        RunError
            if the times are outside the run or not in increasing order, or if there are fewer than
            two samples of the observables

        Examples
        --------
        >>> ideal = run.observable("all/kinetic_energy").value[-1] * run.n_disks
        >>> bool(run.pressure(0, run.time[-1]) > 1.5 * ideal)
        True
        """
        if self.shear_rate:
            return float(np.trace(self.pressure_tensor(t1, t2)) / 2)
        allow(self, "its kinetic energy is no pressure", *TRAITS.keys() - {"random_walk", "open"})
        time, kinetic = self._between("all/kinetic_energy", t1, t2)
        virial = np.diff(self._between("virial", t1, t2).value[[0, -1]])[0]
        duration, area = time[-1] - time[0], time_mean(time, self.accessible_area(time))
        return float((self.n_disks * time_mean(time, kinetic) + virial / (2 * duration)) / area)

    def pressure_tensor(self, t1: float, t2: float) -> np.ndarray:
        """Return the mean pressure tensor between the samples closest in time to `t1` and `t2`.

        It is (<sum of m v_a v_b> + dW_ab / dt) / <A>, where A is the accessible area and dW the
        increase of the virial tensor (`output.virial_tensor = .true.`) during the time dt. Its
        trace is twice the pressure.

        Parameters
        ----------
        t1, t2 : float
            times

        Returns
        -------
        numpy.ndarray
            (2, 2) pressure tensor [energy/length^2]

        Raises
        ------
        RunError
            if there is no virial tensor, if the times are outside the run or not in increasing
            order, or if there are fewer than two samples of the observables

        Examples
        --------
        >>> tensor = run.pressure_tensor(0, run.time[-1])
        >>> bool(np.isclose(np.trace(tensor) / 2, run.pressure(0, run.time[-1])))
        True
        """
        allow(self, "its kinetic energy is no pressure", *TRAITS.keys() - {"random_walk", "open"})
        time, kinetic = self._between("kinetic_tensor", t1, t2)
        virial = np.subtract(*self._between("virial_tensor", t1, t2).value[[-1, 0]])
        duration, area = time[-1] - time[0], time_mean(time, self.accessible_area(time))
        return ((time_mean(time, kinetic) + virial / duration) / area).reshape(2, 2)

    def _between(self, name: str, t1: float, t2: float) -> Series:
        """Return samples of an observable from the one closest to `t1` to that closest to `t2`."""
        time, value = self.observable(name)
        if not t1 < t2:
            raise RunError(f"{self.path}: the first time, {t1:g}, must be below the second, {t2:g}")
        start, end = min(time[0], self.time[0]), max(time[-1], self.time[-1])
        slack = 1e-9 * (end - start)  # for the rounding of times
        if t1 < start - slack or t2 > end + slack:
            raise RunError(
                f"{self.path}: extends from t = {start:g} to {end:g}, not from {t1:g} to {t2:g}"
            )
        first, last = (int(np.argmin(np.abs(time - t))) for t in (t1, t2))
        if not time[first] < time[last]:
            raise RunError(
                f"{self.path}: has no two samples of the observables from t = {t1:g} to {t2:g}; "
                "set output.observables_every_time"
            )
        return Series(time[first : last + 1], value[first : last + 1])


def time_mean(time: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Return the time average of samples (T, ...) by the trapezoidal rule."""
    return np.trapezoid(value, time, axis=0) / (time[-1] - time[0])

"""String stability of a real vehicle: the exact linear theory of its fitted law, with the fit's uncertainty."""

from __future__ import annotations

import math
import warnings
from typing import NamedTuple

import numpy as np

from headway.calibration.fit import Fit
from headway.checked import typed
from headway.errors import HeadwayError, HeadwayWarning
from headway.scenario.vehicle import Vehicle
from headway.theory.linear import Linear, linearize
from headway.theory.sentences import gain_text

__all__ = ["StringVerdict", "theory_of", "verdict"]


class StringVerdict(NamedTuple):
    """Linear theory of a fitted vehicle at one speed, with the fit's uncertainty.

    Attributes:
        speed: the speed [m/s].
        peak: sup |G| of the fit [1].
        frequency: where it is [rad/s].
        low: lower end of the 95 % interval of the peak over the refits.
        high: upper end.
        unstable: share of the refits that are string unstable, 0 to 1.
        without: share of the refits that have no equilibrium at this speed, 0 to 1.
        stable: whether the fit itself is string stable.
    """

    speed: float
    peak: float
    frequency: float
    low: float
    high: float
    unstable: float
    without: float
    stable: bool

    @property
    def words(self) -> str:
        """The verdict in words."""
        sure = self.unstable if not self.stable else 1.0 - self.unstable
        kind = "string stable" if self.stable else "string unstable"
        how = "surely" if sure >= 0.975 else "probably" if sure >= 0.8 else "undecided, by the fit"
        size = "without bound" if math.isinf(self.peak) else f"{gain_text(self.peak)} at {self.frequency:.2g} rad/s"
        interval = "[" + ", ".join(gain_text(x) if math.isfinite(x) else f"{x}" for x in (self.low, self.high)) + "]"
        return f"{how} {kind}: peak gain {size} {interval}, {100 * self.unstable:.0f} % of refits unstable"


def theory_of(fit: Fit, car: Vehicle, speed: float) -> Linear | None:
    """Linear theory of a vehicle of a fit, None where it has none.

    A law that rests at every gap (GMM) is looked at with the mean recorded gap.

    Args:
        fit: the fit that the vehicle belongs to.
        car: its vehicle, or one of its draws.
        speed: [m/s].
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HeadwayWarning)
        try:
            return linearize(car, speed, fit.gap if car.model.rests_everywhere else None)
        except HeadwayError:
            return None


@typed
def verdict(fit: Fit, speed: float | None = None) -> StringVerdict:
    """The string-stability verdict of a fitted vehicle.

    Args:
        fit: the fit.
        speed: [m/s]; the mean recorded speed of its training if None.

    Raises:
        HeadwayError: where the fitted law has no equilibrium at that speed.
        LeaderHeardError: where it hears the platoon leader.
    """
    from headway.theory import sweep

    at = fit.speeds[1] if speed is None else float(speed)
    own = theory_of(fit, fit.vehicle, at)
    if own is None:
        raise HeadwayError(
            f"{fit.vehicle.model.name} as fitted has no equilibrium at {at:.4g} m/s; ask for another speed"
        )
    linears = [lin for car in fit.draws if (lin := theory_of(fit, car, at)) is not None]
    rows = sweep.rows_of([own, *linears])
    gain, frequency = sweep.peaks_of(rows)
    unstable = ~sweep.judge(rows).string_stable
    # without refits that rest there is nothing to be sure by
    low, high = np.quantile(gain[1:], (0.025, 0.975), method="nearest") if linears else (math.nan, math.nan)
    return StringVerdict(
        at, float(gain[0]), float(frequency[0]), float(low), float(high),
        float(unstable[1:].mean()) if linears else math.nan,
        1.0 - len(linears) / fit.refits.shape[1], not bool(unstable[0]),
    )  # fmt: skip

"""The points of a map: which vehicle, equilibrium and frequency belong to values on axes."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from headway.errors import HeadwayError, LeaderHeardError, unknown_name
from headway.models import RADIO, Model, dual
from headway.models.equilibrium import gaps_at
from headway.models.signal import LEADER, SIGNALS, steady
from headway.scenario.reception import Perception
from headway.scenario.vehicle import Vehicle
from headway.theory.corners import RESTS
from headway.theory.transfer import delay_columns

__all__ = ["OperatingPoints", "is_delay"]

Array = NDArray[np.float64]

_PLAIN = ("speed", "gap", "delay", "radio_delay", "lag", "omega")
#: delays and lags [s] that a map goes up to
_MOST_SECONDS = 1e6


def is_delay(name: str) -> bool:
    """Whether an axis is a delay: `delay`, `radio_delay`, or that of one signal."""
    return name in ("delay", "radio_delay") or name.startswith("delay.")


@dataclass(frozen=True)
class OperatingPoints:
    """What the axes of a map mean: the vehicle, its equilibrium and the frequency at every point.

    Attributes:
        vehicle: the vehicle of the map, where no axis changes it.
        names: of the axes.
        speed: [m/s] where it is no axis; None where it follows from the gap, or is one.
        gap: [m] where it is no axis; None where it follows from the speed, or is one.
        omega: frequency [rad/s] where it is no axis; None for a map without frequency, or where it is one.
        what: kind of map, one of `headway.theory.map.WHAT`.
    """

    vehicle: Vehicle
    names: tuple[str, ...]
    speed: float | None
    gap: float | None
    omega: float | None
    what: str

    @property
    def has_frequency(self) -> bool:
        """Whether the map is for one frequency, or has it as an axis."""
        return self.omega is not None or "omega" in self.names

    @property
    def _model(self) -> Model:
        return self.vehicle.model

    def check(self, low: Mapping[str, float], high: Mapping[str, float]) -> None:
        """Refuse axes that mean nothing or leave what is allowed.

        Args:
            low: the lowest value of each axis by name.
            high: the highest value of each axis by name.

        Raises:
            HeadwayError: naming the axis and what is allowed.
        """
        law = self._model.law
        signals = [f"delay.{n}" for n in law.signals]
        if "dv" in law.signals and "vl" not in law.signals:
            signals.append("delay.vl")
        for name in self.names:
            if name in law.parameters:
                for end in (low[name], high[name]):
                    law.parameters[name].check(end, law.name)
                continue
            if name not in (*_PLAIN, *signals):
                raise unknown_name(f"axis of a map of {law.name}", name, (*law.parameters, *_PLAIN, *signals))
            if low[name] < 0 or (low[name] == 0 and name in ("gap", "omega")):
                kind = "above 0" if name in ("gap", "omega") else "0 or more"
                raise HeadwayError(f"axis {name}: {low[name]:g} is not allowed; it must be {kind}")
            if (is_delay(name) or name == "lag") and high[name] > _MOST_SECONDS:
                raise HeadwayError(f"axis {name}: {high[name]:g} s is not allowed; it goes up to {_MOST_SECONDS:g} s")
        for name, number in (("speed", self.speed), ("gap", self.gap), ("omega", self.omega)):
            if number is not None and name in self.names:
                raise HeadwayError(f"{name} is an axis of the map and given as {number:g}; leave one of them out")
        if self.has_frequency and self.what != "gain":
            raise HeadwayError(f"omega belongs to a map of the gain, not to one of {self.what}")
        self._check_delays()
        if self._source("speed") is None and self._source("gap") is None:
            raise HeadwayError(f"a map of {law.name} needs the speed of the platoon [m/s], as a number or as an axis")
        Perception.of(law.name, law.signals, tuple((n, 0.0) for n in self._pattern()))

    def _check_delays(self) -> None:
        """Raise `HeadwayError` for axes of delays that have no effect, or say of one signal two things."""
        law = self._model.law
        on_board, radio = (tuple(n for n in law.signals if (n in RADIO) == far) for far in (False, True))
        late = [n for n in self.names if is_delay(n)]
        if self.what == "critical_delay" and late:
            raise HeadwayError(
                f"axis {late[0]}: a map of the critical delay scales the pattern of delays, so delays are no axes of it"
            )
        for name, signals, other, where in (
            ("delay", on_board, "radio_delay", "measures nothing on board"),
            ("radio_delay", radio, "delay", "hears nothing by radio"),
        ):
            if name not in late:
                continue
            if not signals:
                raise HeadwayError(f"axis {name} has no effect: {law.name} {where}; its delays are those of {other}")
            alone = [n for n in late if n.partition(".")[2] in signals or (name == "delay" and self._composed(n))]
            if alone:
                raise HeadwayError(f"axes {name} and {alone[0]}: make all these signals late alike or one by one")

    def _composed(self, name: str) -> bool:
        """Whether an axis makes the leader's speed in `dv` late by itself."""
        return name == "delay.vl" and "vl" not in self._model.law.signals

    def rows(self, at: Mapping[str, Any]) -> tuple[Array, NDArray[np.bool_], Array | None]:
        """Return the rows of compiled theory for values on the axes.

        Args:
            at: values by axis, arrays that broadcast to one shape.

        Returns:
            (rows, equilibrium, frequency): rows of `sweep.COLUMNS` (*shape, columns), whether there is an
            equilibrium (*shape,), and frequencies [rad/s] (*shape,) or None for a map without.

        Raises:
            LeaderHeardError: where growth per vehicle is to be mapped and the law hears the platoon leader.
        """
        from headway.theory.sweep import COLUMNS

        at = {n: np.asarray(x, dtype=float) for n, x in at.items()}
        shape = np.broadcast_shapes(*(x.shape for x in at.values()))
        slopes, rests = self._linear(at)
        columns = {**slopes, **self._delays(at), "lag": at.get("lag", self.vehicle.lag)}
        rows = np.zeros((*shape, len(COLUMNS)))
        for k, name in enumerate(COLUMNS):
            rows[..., k] = columns.get(name, 0.0)
        whole = np.broadcast_to(rests, shape)
        self._refuse_leader(slopes, whole)
        rows[~whole] = 0.0
        rows[~whole, 0], rows[~whole, 1] = 1.0, -2.0  # any stable vehicle: these points are not looked at
        frequency = at.get("omega", self.omega)
        return rows, whole, None if frequency is None else np.ascontiguousarray(np.broadcast_to(frequency, shape))

    def _refuse_leader(self, slopes: Mapping[str, Any], rests: NDArray[np.bool_]) -> None:
        """Raise `LeaderHeardError` where growth per vehicle is to be mapped and the law hears the platoon leader."""
        if self.what == "local":
            return
        for name in (n for n in self._model.law.signals if SIGNALS[n].of == LEADER):
            if name in slopes and np.any(np.broadcast_to(slopes[name], rests.shape)[rests] != 0.0):
                raise LeaderHeardError(
                    f"a {self.what} map of {self._model.name}: it hears the platoon leader ({name}), so no growth per "
                    "vehicle is defined; map what = 'local', or sweep head_to_tail_gain with Study.stability"
                )

    def _source(self, name: str) -> Any:
        return name if name in self.names else getattr(self, name)

    def _linear(self, at: Mapping[str, Array]) -> tuple[dict[str, Array], NDArray[np.bool_]]:
        """Return partial derivatives by signal and where there is an equilibrium, on as few points as axes allow."""
        law = self._model.law
        parameters: dict[str, Any] = {n: at.get(n, x) for n, x in self._model.items}
        v, s = at.get("speed", self.speed), at.get("gap", self.gap)
        chosen = v is not None and s is not None
        if v is None:
            v = self._speeds(parameters, s)
        if s is None:
            s = gaps_at(law, parameters, v)
        inputs = np.broadcast_arrays(v, s, *parameters.values())
        v, s = np.array(inputs[0], float), np.array(inputs[1], float)
        rests = np.isfinite(v) & np.isfinite(s) & (v >= 0) & (s > 0)
        v[~rests], s[~rests] = 1.0, 1.0
        signals = steady(law.signals, s, v)
        try:
            model = Model(law, tuple(parameters.items()))
            slopes = dual.partials(model, signals)
            rest = model(*signals.values())
        except (TypeError, ValueError):  # a law that branches with `if`: one point after the other
            values = dict(zip(parameters, inputs[2:], strict=True))
            slopes, rest = {n: np.empty(v.shape) for n in signals}, np.empty(v.shape)
            for i in np.ndindex(v.shape):
                model = Model(law, tuple((n, float(x[i])) for n, x in values.items()))
                for n, x in dual.partials(model, {n: float(x[i]) for n, x in signals.items()}).items():
                    slopes[n][i] = x
                rest[i] = model(*(float(x[i]) for x in signals.values()))
        if chosen:
            rests &= np.abs(rest) <= RESTS
        for x in slopes.values():
            rests &= np.isfinite(x)
        return slopes, rests

    def _speeds(self, parameters: Mapping[str, Any], s: Any) -> Array:
        """Return equilibrium speeds [m/s] at gaps, NaN where there is none."""
        law = self._model.law
        names, arrays = tuple(parameters), np.broadcast_arrays(s, *parameters.values())
        speeds = np.full(arrays[0].shape, np.nan)
        form = law.forms.get("equilibrium_speed")
        with suppress(TypeError, ValueError):
            if form is not None:
                with np.errstate(all="ignore"):
                    speeds[...] = form(s, **parameters)
                return np.where(speeds >= 0, speeds, np.nan)
        for i in np.ndindex(speeds.shape):
            model = law(**{n: float(x[i]) for n, x in zip(names, arrays[1:], strict=True)})
            with suppress(HeadwayError):
                speeds[i] = model.equilibrium_speed(float(arrays[0][i]))
        return speeds

    def _pattern(self) -> dict[str, float]:
        """Return delays [s] by signal: the vehicle's own, and those that axes change or a critical delay scales.

        `delay` is what `Vehicle(delay=x)` says: all on-board signals late by x, and the radio current.
        """
        signals = self._model.law.signals
        on_board = [n for n in signals if n not in RADIO]
        delay = self.vehicle.delay
        delays = dict.fromkeys(on_board if delay else (), delay) if isinstance(delay, float) else dict(delay)
        if "delay" in self.names or (self.what == "critical_delay" and not any(delays.values())):
            delays = dict.fromkeys(on_board, 1.0)
        if "radio_delay" in self.names:
            delays |= {n: 1.0 for n in signals if n in RADIO}
        return {**delays, **{n.partition(".")[2]: 0.0 for n in self.names if n.startswith("delay.")}}

    def _delays(self, at: Mapping[str, Array]) -> dict[str, Any]:
        """Return the delays of a row, by column."""
        law, pattern = self._model.law, self._pattern()
        total: dict[str, Any] = {}
        for name, seconds in pattern.items():
            # delays of what is perceived are linear in the delays given by signal
            alone = Perception.of(law.name, law.signals, tuple((n, float(n == name)) for n in pattern))
            together = "radio_delay" if name in RADIO and name in law.signals else "delay"
            amount = at.get(f"delay.{name}", at.get(together, seconds))
            for column, share in delay_columns(alone).items():
                total[column] = total.get(column, 0.0) + share * amount
        return total

    @property
    def on_time(self) -> bool:
        """Whether the vehicle has no delay, so that a critical delay is that of all on-board signals."""
        delay = self.vehicle.delay
        return not (delay if isinstance(delay, float) else any(t for _, t in delay))

    def explain(self, at: Mapping[str, Array]) -> None:
        """Say why no point of a map has an equilibrium, in the words of the model in the middle of the map.

        Args:
            at: values by axis.

        Raises:
            HeadwayError: always.
        """
        if self._source("speed") is not None and self._source("gap") is not None:
            raise HeadwayError(f"{self._model.name} rests at no speed and gap of the map; leave the gap to it")
        middle = {n: float(x.ravel()[x.size // 2]) for n, x in at.items()}
        model = self._model.replace(**{n: x for n, x in middle.items() if n in self._model.law.parameters})
        if self._source("speed") is not None:
            model.equilibrium_gap(middle.get("speed", self.speed or 0.0))
        else:
            model.equilibrium_speed(middle.get("gap", self.gap or 0.0))
        raise HeadwayError(f"{model.name} has no differentiable equilibrium anywhere on the map")

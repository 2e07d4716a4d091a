"""A follower: a model, what it knows and how late, its actuator and its length."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator

from headway.checked import SMALLEST
from headway.errors import HeadwayError
from headway.models import Law, Model
from headway.scenario.reception import Delay, Perception, normalize_delay
from headway.scenario.validation import Described, Negative, NonNegative, Positive, spec, unit

__all__ = ["Vehicle"]


def _model(value: Any) -> Any:
    if isinstance(value, Law):
        return value()
    if not isinstance(value, Model):
        raise HeadwayError(
            f"vehicle.model = {value!r} is not a model; take one from headway.models or make a law with @headway.model"
        )
    return value


def _lag(value: Any) -> Any:
    return 0.0 if isinstance(value, float) and 0.0 < value < SMALLEST else value


@spec
class Vehicle(metaclass=Described):
    """A follower.

    model: a model or a law (then with its default parameters).
    delay: seconds for all on-board signals, or a mapping from signal to seconds (`Perception`).
    lag: time constant [s] of a first-order actuator, a' = (command - a)/lag; 0 acts at once.
    length: [m], bumper to bumper gaps start behind it.
    limits: least and largest acceleration [m/s²] that the vehicle can be commanded, or None.

    A delay or lag below a nanosecond is none.
    """

    model: Annotated[Any, BeforeValidator(_model)]
    delay: Annotated[
        Any,
        BeforeValidator(normalize_delay),
        unit("s", "delay of all on-board signals, or of each signal by name"),
    ] = 0.0
    lag: Annotated[NonNegative, BeforeValidator(_lag), unit("s", "time constant of the actuator")] = 0.0
    length: Annotated[NonNegative, unit("m", "length of the vehicle")] = 5.0
    limits: Annotated[
        tuple[Negative, Positive] | None,
        unit("m/s²", "least and largest acceleration that can be commanded"),
    ] = None

    def __post_init__(self) -> None:
        Perception.of(self.model.name, self.model.law.signals, self.delay)

    @property
    def perception(self) -> Perception:
        """What the model perceives, and how late."""
        delay: Delay = self.delay
        return Perception.of(self.model.name, self.model.law.signals, delay)

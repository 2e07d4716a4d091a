"""What leaders say of themselves, so that nobody asks for their kind."""

from __future__ import annotations

from typing import Annotated, ClassVar

import pytest

import headway as hw
from headway.engine.plan import Plan
from headway.explorer.controls import controls
from headway.explorer.state import Limits, _bound
from headway.scenario.leaders import KINDS, Constant, Disturbance, Repeating
from headway.scenario.validation import Positive, spec, unit

#: what leaders say of themselves: kinds that repeat themselves, settle, depend on the seed, are sines
SAYS = {
    "repeat": ("sawtooth", "sine", "square", "triangle"),
    "settle": ("brake", "step", "window"),
    "random": ("noise",),
    "harmonic": ("sine", "window"),
}


def test_leaders_say_of_themselves_what_they_are():
    assert tuple(sorted(k for k, c in KINDS.items() if issubclass(c, Repeating))) == SAYS["repeat"]
    assert tuple(sorted(k for k, c in KINDS.items() if c.settles)) == SAYS["settle"]
    assert tuple(sorted(k for k, c in KINDS.items() if c.random)) == SAYS["random"]
    assert tuple(sorted(k for k, c in KINDS.items() if c.harmonic)) == SAYS["harmonic"]


def test_fundamental_and_frequencies():
    assert hw.square(20, 1, 0.5).fundamental == 0.5
    assert hw.square(20, 1, 0.5).frequencies == (0.5,)
    assert hw.window(20, 1, 0.5, 10).fundamental is None
    assert hw.window(20, 1, 0.5, 10).frequencies == (0.5,)
    assert hw.chirp(20, 1, 0.1, 2.0, 30).frequencies == (0.1, 2.0)
    assert hw.multisine(20, (1, 1), (0.4, 1.1)).frequencies == (0.4, 1.1)
    assert hw.constant(20).frequencies == ()


@spec
class Tremble(Disturbance):
    """Steady, but by chance."""

    strength: Annotated[Positive, unit("m/s", "how much it trembles", usual=[0.3, 0.1, 0.9])]
    kind: ClassVar[str] = "tremble"
    random: ClassVar[bool] = True

    def motion(self, seed, duration):
        return Constant(20.0 + self.strength * seed).motion(seed, duration)


def test_a_new_leader_is_known_by_what_it_says(monkeypatch):
    """A kind of its own file: plan, page and limits of the page ask it, not its name."""
    monkeypatch.setitem(KINDS, "tremble", Tremble)
    car = hw.Vehicle(hw.models.IDM())
    plan = Plan.of([hw.Scenario(Tremble(0.5), [car], 10, initial_speed=20, seed=seed) for seed in (1, 2)])
    assert len(plan.motions) == 2
    kind = controls()["kinds"]["tremble"]
    assert kind["random"]
    (field,) = kind["fields"]
    assert (field["start"], field["slider"]["low"], field["slider"]["high"]) == (0.3, 0.1, 0.9)
    with pytest.raises(hw.HeadwayError, match="tremble' leader changes too often"):
        _bound({"followers": [{"count": 1}], "duration": 60, "leader": {"kind": "tremble", "omega": 1e9}}, Limits())

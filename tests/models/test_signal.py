"""The table of signals, and that a new row is all that a new signal takes."""

from __future__ import annotations

import numpy as np
import pytest

import headway as hw
from headway.models.signal import AHEAD, LEADER, OWN, RADIO, SIGNALS, steady


def test_values_in_steady_traffic():
    at = steady(SIGNALS, 20.0, 15.0)
    assert at == {"s": 20.0, "v": 15.0, "dv": 0.0, "a": 0.0, "vl": 15.0, "al": 0.0, "v0l": 15.0, "a0l": 0.0}


def test_values_of_motions():
    motions = {OWN: (0.0, 10.0, 1.0), AHEAD: (30.0, 12.0, 2.0), LEADER: (90.0, 14.0, 3.0)}
    values = {name: signal.value(motions) for name, signal in SIGNALS.items()}
    assert values == {"s": 30.0, "v": 10.0, "dv": 2.0, "a": 1.0, "vl": 12.0, "al": 2.0, "v0l": 14.0, "a0l": 3.0}


def test_what_people_call_a_signal_leads_to_it():
    with pytest.raises(hw.HeadwayError, match=r"'velocity' is not known; did you mean 'v', own speed\?"):

        @hw.model
        def mine(s, velocity):
            return s - velocity


def test_units_and_radio_follow_from_the_row():
    assert {"vl", "al", "v0l", "a0l"} == RADIO
    for signal in SIGNALS.values():
        assert signal.unit == ("m", "m/s", "m/s²")[signal.order]
        assert np.isfinite(signal.steady(10.0, 5.0))

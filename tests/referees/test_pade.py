"""python-control as an outside referee: the same vehicles, built anew with Padé approximations of order 12.

Nothing here uses headway's transfer functions: a vehicle is put together from integrators, an
actuator, one Padé element for each late signal and the law's partial derivatives as gains.
"""

from __future__ import annotations

import warnings

import control
import numpy as np
import pytest
from late import late

import headway as hw
from headway.models import CACC, FVDM, GMM, IDM, OVM

ORDER = 12

#: vehicle, speed, gap; what is compared is stated in the tests
CASES = {
    "idm, all signals 1.5 s late": (hw.Vehicle(IDM, delay=1.5), 23.0, None),
    "idm, gap and leader's speed late, slow actuator": (
        hw.Vehicle(IDM, delay={"s": 0.8, "vl": 1.2}, lag=0.3), 15.0, None,
    ),
    "fvdm, gap and measured relative speed late": (
        hw.Vehicle(FVDM(alpha=2, lam=1, v0=20, h=25, w=12), delay={"s": 0.3, "dv": 0.2}), 15.0, None,
    ),
    "gmm, all signals 4 s late": (hw.Vehicle(GMM, delay=4.0), 15.0, 12.0),
    "ovm, gap later than own speed": (
        hw.Vehicle(OVM(alpha=3, v0=20, h=25, w=12), delay={"s": 0.2, "v": 0.1}, lag=0.1), 15.0, None,
    ),
    "cacc, radio late, slow actuator": (hw.Vehicle(CACC, delay={"vl": 0.4, "al": 0.7}, lag=0.3), 15.0, None),
}  # fmt: skip


def referee(vehicle, speed, gap):
    """From the speed of the vehicle ahead, `ahead`, to one's own, `own`, as a rational state-space system."""
    f, delays = vehicle.model.partials(speed, gap), late(vehicle)
    command = "command"
    blocks = [control.ss(0, 1, 1, 0, inputs="rate", outputs="own")]
    if vehicle.lag > 0:
        blocks.append(control.ss(-1 / vehicle.lag, 1 / vehicle.lag, 1, 0, inputs="command", outputs="rate"))
    else:
        command = "rate"

    def delayed(source, seconds, name, derivative=False):
        # with one power less on top, the delayed signal can be differentiated
        top, bottom = control.pade(seconds, ORDER, ORDER - 1 if derivative else ORDER) if seconds else ([1.0], [1.0])
        block = control.tf([*top, 0.0] if derivative else top, bottom)
        blocks.append(control.ss(block, inputs=source, outputs=name))
        return name

    gains = {}
    if f.get("s"):
        blocks += [
            control.summing_junction(["ahead", "-own"], "opening"),
            control.ss(0, 1, 1, 0, inputs="opening", outputs="gap"),
        ]
        gains[delayed("gap", delays.get("s", 0.0), "late gap")] = f["s"]
    if f.get("v"):
        gains[delayed("own", delays.get("v", 0.0), "late own")] = f["v"]
    if f.get("dv"):
        gains[delayed("ahead", delays.get("dv ahead", 0.0), "late ahead in dv")] = f["dv"]
        gains[delayed("own", delays.get("dv own", 0.0), "late own in dv")] = -f["dv"]
    if f.get("vl"):
        gains[delayed("ahead", delays.get("vl", 0.0), "received speed")] = f["vl"]
    if f.get("al"):
        gains[delayed("ahead", delays.get("al", 0.0), "received acceleration", derivative=True)] = f["al"]
    if f.get("a"):
        gains["rate"] = f["a"]
    blocks.append(control.ss([], [], [], [list(gains.values())], inputs=list(gains), outputs=command))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return control.interconnect(blocks, inputs="ahead", outputs="own")


@pytest.fixture(params=CASES)
def pair(request):
    vehicle, speed, gap = CASES[request.param]
    return hw.linearize(vehicle, speed, gap), referee(vehicle, speed, gap)


def test_frequency_response(pair):
    """Within 1e-6 from 0.01 to 3 rad/s, gain and phase."""
    theory, rational = pair
    omega = np.geomspace(0.01, 3.0, 200)
    assert theory.transfer(1j * omega) == pytest.approx(rational(1j * omega), abs=1e-6)


def test_peak_gain(pair):
    """The largest magnitude from 1e-4 to 50 rad/s, within 1e-6.

    control.norm is no use here: without slycot it takes eigenvalues for imaginary within an absolute
    1e-8, which those of a Padé element are not.
    """
    theory, rational = pair
    low, high = 1e-4, 50.0
    for _ in range(3):
        omega = np.geomspace(low, high, 2001)
        gain = np.abs(rational(1j * omega))
        best = int(np.argmax(gain))
        low, high = omega[max(best - 1, 0)], omega[min(best + 1, 2000)]
    assert theory.peak_gain == pytest.approx(gain[best], abs=1e-6)


def test_rightmost_root(pair):
    """The rightmost pole within 1e-6."""
    theory, rational = pair
    poles = rational.poles()
    rightmost = poles[np.argmax(poles.real + 1e-9 * poles.imag)]
    assert theory.rightmost_root == pytest.approx(rightmost, abs=1e-6)

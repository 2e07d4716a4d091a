"""What happens to a disturbance as it travels down a platoon of vehicles, for this law, these delays, these parameters?

    import headway as hw

    car = hw.Vehicle(hw.models.IDM(T=1.2), delay=0.15)
    sc = hw.Scenario(hw.sine(mean=23, amplitude=2, omega=0.63), [car] * 5, duration=50)
    tr = hw.simulate(sc)
    hw.plot.speeds(tr)

Names are loaded when they are first used, so that importing headway costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from headway.version import __version__

#: public name → (module, name in it; None for the module itself)
_PUBLIC: dict[str, tuple[str, str | None]] = {
    "models": ("headway.models", None),
    "model": ("headway.models.law", "model"),
    "Param": ("headway.models.law", "Param"),
    "Law": ("headway.models.law", "Law"),
    "Model": ("headway.models.law", "Model"),
    "maths": ("headway.maths", None),
    "check_model": ("headway.analysis.conformance", "check_model"),
    "load_laws": ("headway.models.own", "load_laws"),
    "Vehicle": ("headway.scenario.vehicle", "Vehicle"),
    "Scenario": ("headway.scenario.scenario", "Scenario"),
    "load": ("headway.scenario.files", "load"),
    "from_toml": ("headway.scenario.files", "from_toml"),
    "constant": ("headway.scenario.disturbance", "Constant"),
    "sine": ("headway.scenario.disturbance", "Sine"),
    "window": ("headway.scenario.disturbance", "Window"),
    "step": ("headway.scenario.disturbance", "Step"),
    "brake": ("headway.scenario.disturbance", "Brake"),
    "square": ("headway.scenario.disturbance", "Square"),
    "sawtooth": ("headway.scenario.disturbance", "Sawtooth"),
    "triangle": ("headway.scenario.disturbance", "Triangle"),
    "multisine": ("headway.scenario.disturbance", "Multisine"),
    "chirp": ("headway.scenario.disturbance", "Chirp"),
    "noise": ("headway.scenario.disturbance", "Noise"),
    "cycle": ("headway.scenario.disturbance", "Cycle"),
    "recorded": ("headway.scenario.recorded", "Recorded"),
    "library": ("headway.library", None),
    "behind": ("headway.scenario.behind", "behind"),
    "simulate": ("headway.engine.simulate", "simulate"),
    "simulate_many": ("headway.engine.simulate", "simulate_many"),
    "linearize": ("headway.analysis.linear", "linearize"),
    "head_to_tail": ("headway.analysis.linear", "head_to_tail"),
    "stability_map": ("headway.analysis.map", "stability_map"),
    "StabilityMap": ("headway.analysis.map", "StabilityMap"),
    "metrics": ("headway.metrics", None),
    "Study": ("headway.study.study", "Study"),
    "between": ("headway.study.axes", "between"),
    "load_study": ("headway.study.files", "load_study"),
    "open_study": ("headway.study.study", "open_study"),
    "calibrate": ("headway.calibration.fit", "calibrate"),
    "calibration": ("headway.calibration", None),
    "save": ("headway.results", "save"),
    "open_results": ("headway.results", "open_results"),
    "data": ("headway.data", None),
    "plot": ("headway.plot", None),
    "explore": ("headway.explorer", "explore"),
    "HeadwayError": ("headway.errors", "HeadwayError"),
    "HeadwayWarning": ("headway.errors", "HeadwayWarning"),
}

__all__ = ["__version__", *_PUBLIC]

if TYPE_CHECKING:
    from headway import calibration, data, library, maths, metrics, models, plot
    from headway.analysis.conformance import check_model
    from headway.analysis.linear import head_to_tail, linearize
    from headway.analysis.map import StabilityMap, stability_map
    from headway.calibration.fit import calibrate
    from headway.engine.simulate import simulate, simulate_many
    from headway.errors import HeadwayError, HeadwayWarning
    from headway.explorer import explore
    from headway.models.law import Law, Model, Param, model
    from headway.models.own import load_laws
    from headway.results import open_results, save
    from headway.scenario.behind import behind
    from headway.scenario.disturbance import Brake as brake
    from headway.scenario.disturbance import Chirp as chirp
    from headway.scenario.disturbance import Constant as constant
    from headway.scenario.disturbance import Cycle as cycle
    from headway.scenario.disturbance import Multisine as multisine
    from headway.scenario.disturbance import Noise as noise
    from headway.scenario.disturbance import Sawtooth as sawtooth
    from headway.scenario.disturbance import Sine as sine
    from headway.scenario.disturbance import Square as square
    from headway.scenario.disturbance import Step as step
    from headway.scenario.disturbance import Triangle as triangle
    from headway.scenario.disturbance import Window as window
    from headway.scenario.files import from_toml, load
    from headway.scenario.recorded import Recorded as recorded
    from headway.scenario.scenario import Scenario
    from headway.scenario.vehicle import Vehicle
    from headway.study.axes import between
    from headway.study.files import load_study
    from headway.study.study import Study, open_study


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        from headway.errors import did_you_mean

        raise AttributeError(f"headway has no {name!r}{did_you_mean(name, _PUBLIC)}")
    module, attribute = _PUBLIC[name]
    loaded = importlib.import_module(module)
    return loaded if attribute is None else getattr(loaded, attribute)


def __dir__() -> list[str]:
    return sorted(__all__)

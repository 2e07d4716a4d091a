"""What happens to a disturbance as it travels down a platoon of vehicles, for this law, these delays, these parameters?

    import headway as hw

    car = hw.Vehicle(hw.models.IDM(T=1.2), delay=0.15)
    sc = hw.Scenario(hw.sine(mean=23, amplitude=2, omega=0.63), [car] * 5, duration=50)
    tr = hw.simulate(sc)
    hw.plot.speeds(tr)

Names are loaded when they are first used, so that importing headway costs nothing.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path
from typing import Any

from headway.version import __version__


def _names() -> dict[str, tuple[str, str | None]]:
    """Public name → (module, name in it; None for the module itself), as the stub beside this file says them."""
    public: dict[str, tuple[str, str | None]] = {}
    hidden: dict[str, tuple[str, str | None]] = {}
    for node in ast.parse(Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            for alias in node.names:
                whole = node.module == "headway"
                place = (f"headway.{alias.name}", None) if whole else (node.module, alias.name)
                (public if alias.asname else hidden)[alias.name] = place
        elif isinstance(node, ast.Assign) and isinstance(node.value, ast.Name):
            public |= {target.id: hidden[node.value.id] for target in node.targets if isinstance(target, ast.Name)}
    return public


_PUBLIC = {name: place for name, place in _names().items() if name != "__version__"}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        from headway.errors import did_you_mean

        raise AttributeError(f"headway has no {name!r}{did_you_mean(name, _PUBLIC)}")
    module, attribute = _PUBLIC[name]
    loaded = importlib.import_module(module)
    return loaded if attribute is None else getattr(loaded, attribute)


def __dir__() -> list[str]:
    return sorted(__all__)

"""Draw the figures of docs/stability.md: `python examples/stability_figures.py [folder]`."""

from __future__ import annotations

import sys
from pathlib import Path

import headway as hw
from headway.literature.barhoumi2025.maps import NAMES, reproduced_map
from headway.models import CACC, IDM


def main(folder: Path) -> None:
    """Write every figure into `folder`."""
    idm = hw.linearize(hw.Vehicle(IDM), 23.0)
    radio = hw.linearize(hw.Vehicle(CACC, delay={"vl": 0.15, "al": 0.15}), 23.0)
    slow = hw.linearize(hw.Vehicle(IDM(v0=33.3)), 5.0)
    pattern = hw.Vehicle(IDM, delay=1.0)
    over_delay = hw.stability_map(pattern, {"T": (0.5, 2.5), "delay": (0.0, 1.5)}, speed=23.0)
    figures = {
        "gain-phase": hw.plot.gain_phase(idm, delays=(0.0, 0.5, 1.0, 1.5), omega=0.63),
        "responses": hw.plot.responses(radio),
        "root-locus": hw.plot.root_locus(idm, delays=(0.0, 3.5)),
        "propagation": hw.plot.propagation(slow),
        "damping": hw.plot.damping(),
        "map": hw.plot.stability_map(over_delay, point={"T": 1.5, "delay": 0.4}),
        **{f"map-{name}": hw.plot.paper_map(reproduced_map(name)) for name in NAMES},
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        hw.plot.save(figure, folder / f"{name}.png")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/figures"))

"""Areas of verdicts within their traced boundaries instead of the steps of the grid."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from headway.arrays import Array

if TYPE_CHECKING:
    from matplotlib.path import Path

__all__ = ["area", "intervals"]


def intervals(codes: NDArray[Any], code: int, values: Array, lines: Sequence[Array]) -> list[tuple[float, float]]:
    """Return the intervals of an axis in which the verdict is a class or a better one.

    Args:
        codes: verdicts (points,).
        code: of the class.
        values: of the axis (points,), rising.
        lines: points (1, 1) of the traced boundary.

    Returns:
        (low, high) of each interval, in the unit of the axis.
    """
    inside = codes >= code
    ends = np.flatnonzero(np.diff(inside))
    exact = {int(np.searchsorted(values, line[0, 0])) - 1: float(line[0, 0]) for line in lines}
    edges = [exact.get(int(i), 0.5 * (values[i] + values[i + 1])) for i in ends]
    edges = [float(values[0])] * bool(inside[0]) + edges + [float(values[-1])] * bool(inside[-1])
    return list(zip(edges[::2], edges[1::2], strict=True))


def area(codes: NDArray[Any], code: int, axes: Sequence[Array], lines: Sequence[Array]) -> Path:
    """Return the area, with holes, of a plane in which the verdict is a class or a better one.

    The area around points of the grid has a vertex in the middle of each edge of the grid that leads
    out of it. On that edge lies a point of the traced boundary, which takes its place.

    Args:
        codes: verdicts (first axis, second axis).
        code: of the class.
        axes: rising values of both axes.
        lines: polylines (points, 2) of the traced boundary.
    """
    import contourpy
    from matplotlib.path import Path

    inside = (codes >= code).astype(float)
    generator = contourpy.contour_generator(z=inside.T, fill_type=contourpy.FillType.OuterOffset)
    exact = {place: vertex for line in lines for place, vertex in zip(_places(line, axes), line, strict=True)}
    vertices: list[Array] = []
    steps: list[Any] = []
    for outline, offsets in zip(*generator.filled(0.5, 2.0), strict=True):
        middle = np.column_stack([np.interp(outline[:, i], np.arange(a.size), a) for i, a in enumerate(axes)])
        places = map(tuple, np.rint(2.0 * outline).astype(int).tolist())
        vertices += [np.asarray(exact.get(place, at)) for place, at in zip(places, middle, strict=True)]
        for first, last in pairwise(offsets):
            steps += [Path.MOVETO, *[Path.LINETO] * (int(last) - int(first) - 2), Path.CLOSEPOLY]
    return Path(np.array(vertices).reshape(-1, 2), steps or None)


def _places(line: Array, axes: Sequence[Array]) -> list[tuple[int, ...]]:
    """Return twice the index of the grid under each point of a boundary, odd between two grid values."""
    columns = []
    for i, values in enumerate(axes):
        above = np.searchsorted(values, line[:, i])
        on_grid = values[np.minimum(above, values.size - 1)] == line[:, i]
        columns.append(np.where(on_grid, 2 * above, 2 * above - 1))
    return [tuple(place) for place in np.column_stack(columns).tolist()]

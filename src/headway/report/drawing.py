"""A figure as a part of a page, and as a file at print size."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from headway.plot import export

if TYPE_CHECKING:
    from headway.report.parts import Illustration

__all__ = ["inline", "print_size", "svg"]

_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_REFERENCE = re.compile(r"url\(#")


def svg(picture: Illustration) -> str:
    """Return the figure as the text of an SVG file, equal for equal figures; rasters have 150 dots an inch."""
    with io.StringIO() as text, _settings(picture):
        picture.figure.savefig(text, format="svg", dpi=150, metadata={"Date": None})
        return text.getvalue()


def inline(picture: Illustration, drawn: str) -> str:
    """Return a figure as an element of a page, with ids of its own and without references to other files.

    Args:
        picture: the figure with its name.
        drawn: the text of its SVG file.
    """
    root = ElementTree.fromstring(drawn)
    prefix = f"{picture.name}-"
    for parent in root.iter():
        for child in list(parent):
            # a style sheet inside would apply to the whole page; metadata name the web
            if _local(child.tag) in ("metadata", "style"):
                parent.remove(child)
    for element in root.iter():
        element.tag = _local(element.tag)
        element.attrib = {_local(k): _own(_local(k), v, prefix) for k, v in element.attrib.items()}
        element.text = element.tail = None if not (element.text or "").strip() else element.text
    for name in ("version", "width", "height"):
        root.attrib.pop(name, None)
    root.attrib.update({"role": "img", "aria-label": picture.alt})
    # what matplotlib's own style sheet says
    root.set("style", "stroke-linejoin:round;stroke-linecap:butt")
    return ElementTree.tostring(root, encoding="unicode", short_empty_elements=True)


def print_size(picture: Illustration, path: Path) -> None:
    """Write the figure at print size as PDF or PNG, by the suffix of `path`."""
    with _settings(picture):
        export.save(picture.figure, path)


def _settings(picture: Illustration) -> Any:
    """Return settings for equal ids each time, lines without invisible points, and letters as shapes."""
    import matplotlib

    return matplotlib.rc_context(
        {"svg.hashsalt": picture.name, "svg.fonttype": "path", "path.simplify": True, "path.simplify_threshold": 0.2}
    )


def _local(name: str) -> str:
    """Return a name without its namespace, which a page does not need."""
    return name.rpartition("}")[2]


def _own(name: str, value: str, prefix: str) -> str:
    """Return an attribute's value with ids of its own, and paths to a hundredth of a point."""
    if name == "id":
        return prefix + value
    if name == "href" and value.startswith("#"):
        return f"#{prefix}{value[1:]}"
    if name == "d":
        return _NUMBER.sub(_short, value)
    return _REFERENCE.sub(f"url(#{prefix}", value)


def _short(number: re.Match[str]) -> str:
    return f"{float(number.group()):.2f}".rstrip("0").rstrip(".")

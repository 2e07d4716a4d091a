"""The explorer: a page on this machine whose sliders move a platoon and its stability at once.

The page draws; everything it draws is computed here by the same engine and theory as everywhere else.
"""

from headway.explorer.start import Explorer, explore

__all__ = ["Explorer", "explore"]

"""Functions for laws that are as fast as arithmetic once compiled: `where`, `maximum`, `minimum`, `power`, `tanh`."""

from headway.models.maths import maximum, minimum, power, tanh, where

__all__ = ["maximum", "minimum", "power", "tanh", "where"]

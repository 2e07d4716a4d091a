"""The version of headway, said once: the package, its results and its reports take it from here."""

__all__ = ["__version__"]

__version__ = "0.1.0"

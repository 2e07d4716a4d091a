"""Car-following laws and what follows from them."""

from headway.model.law import RADIO, SIGNALS, Law, Model, Param, Parameter, model

__all__ = ["RADIO", "SIGNALS", "Law", "Model", "Param", "Parameter", "model"]

"""Car-following laws and what follows from them."""

from headway.models.law import Law, Model, Param, Parameter, model
from headway.models.registry import BUILT_IN, CACC, FVDM, GMM, IDM, OVM, IDMSpacing
from headway.models.signal import RADIO, SIGNALS, Signal

__all__ = [
    "BUILT_IN", "CACC", "FVDM", "GMM", "IDM", "OVM", "RADIO", "SIGNALS", "IDMSpacing", "Law", "Model", "Param",
    "Parameter", "Signal", "model",
]  # fmt: skip

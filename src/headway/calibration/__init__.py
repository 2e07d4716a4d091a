"""Real platoons: fit laws to recorded followers, test them on other runs and whole strings, see where they fail."""

from headway.calibration.baselines import Errors
from headway.calibration.behind import one_in, replay
from headway.calibration.crossvalidation import cross_validate
from headway.calibration.document import load_followers, save_fits
from headway.calibration.fit import Fit, calibrate
from headway.calibration.measured_transfer import Growth, Transfer, measured_growth, measured_transfer, spectra
from headway.calibration.synthetic import as_recorded
from headway.calibration.uncertainty import Profile
from headway.calibration.verdict import StringVerdict, verdict

__all__ = [
    "Errors", "Fit", "Growth", "Profile", "StringVerdict", "Transfer", "as_recorded", "calibrate",
    "cross_validate", "load_followers", "measured_growth", "measured_transfer", "one_in", "replay",
    "save_fits", "spectra", "verdict",
]  # fmt: skip

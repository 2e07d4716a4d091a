"""The public names, and where they are: type checkers read this file, and so does the package itself.

`import … as` the same name, or an assignment, makes a name public; what is imported without `as` is not.
"""

from headway import calibration as calibration
from headway import data as data
from headway import library as library
from headway import maths as maths
from headway import metrics as metrics
from headway import models as models
from headway import plot as plot
from headway.calibration.fit import calibrate as calibrate
from headway.conformance import check_model as check_model
from headway.engine.simulate import simulate as simulate
from headway.engine.simulate import simulate_many as simulate_many
from headway.errors import HeadwayError as HeadwayError
from headway.errors import HeadwayWarning as HeadwayWarning
from headway.errors import LeaderHeardError as LeaderHeardError
from headway.errors import NoEquilibriumError as NoEquilibriumError
from headway.errors import RestsEverywhereError as RestsEverywhereError
from headway.explorer import explore as explore
from headway.models.law import Law as Law
from headway.models.law import Model as Model
from headway.models.law import Param as Param
from headway.models.law import model as model
from headway.models.own import load_laws as load_laws
from headway.results import open_results as open_results
from headway.results import save as save
from headway.scenario.behind import behind as behind
from headway.scenario.document import from_toml as from_toml
from headway.scenario.document import load as load
from headway.scenario.leaders import (
    Brake,
    Chirp,
    Constant,
    Cycle,
    Multisine,
    Noise,
    Sawtooth,
    Sine,
    Square,
    Step,
    Triangle,
    Window,
)
from headway.scenario.recorded import Recorded
from headway.scenario.scenario import Scenario as Scenario
from headway.scenario.vehicle import Vehicle as Vehicle
from headway.study.axes import between as between
from headway.study.document import load_study as load_study
from headway.study.study import Study as Study
from headway.study.study import open_study as open_study
from headway.theory.linear import linearize as linearize
from headway.theory.map import StabilityMap as StabilityMap
from headway.theory.map import stability_map as stability_map
from headway.theory.platoon import head_to_tail as head_to_tail
from headway.version import __version__ as __version__

constant = Constant
sine = Sine
window = Window
step = Step
brake = Brake
square = Square
sawtooth = Sawtooth
triangle = Triangle
multisine = Multisine
chirp = Chirp
noise = Noise
cycle = Cycle
recorded = Recorded

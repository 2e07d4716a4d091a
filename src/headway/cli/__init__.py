"""The command line. What is typed wrongly gets one sentence on standard error and exit code 2."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence

import cyclopts
from cyclopts import App

from headway.cli.benchmark import benchmark
from headway.cli.calibrate import calibrate
from headway.cli.data import data_app
from headway.cli.explore import explore
from headway.cli.map import map_
from headway.cli.metrics import metrics
from headway.cli.models import check, models
from headway.cli.paper import paper
from headway.cli.replay import replay
from headway.cli.run import run, schema
from headway.cli.stability import stability
from headway.cli.study import study_app
from headway.errors import HeadwayError, HeadwayWarning
from headway.version import __version__

__all__ = ["app", "main"]

app = App(
    name="headway",
    help="What happens to a disturbance as it travels down a platoon of vehicles, for this law, these delays, "
    "these parameters?",
    version=f"headway {__version__}",
    default_parameter=cyclopts.Parameter(negative=()),
    help_format="plaintext",
)
app.command(run)
app.command(stability)
app.command(study_app)
app.command(map_, name="map")
app.command(benchmark)
app.command(paper)
app.command(models)
app.command(metrics)
app.command(check)
app.command(schema)
app.command(data_app)
app.command(calibrate)
app.command(replay)
app.command(explore)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 a check failed, 2 typed wrongly, 130 interrupted."""
    warnings.simplefilter("ignore", HeadwayWarning)  # the command line turns what matters into errors
    try:
        result = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except cyclopts.CycloptsError as error:
        _fail(_plain(error))
    except HeadwayError as error:
        _fail(str(error))
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        sys.exit(0)
    sys.exit(result if isinstance(result, int) else 0)


def _plain(error: cyclopts.CycloptsError) -> str:
    """A parser's message as one line."""
    text = " ".join(str(error).split()).rstrip(".")
    return text[:1].lower() + text[1:]


def _fail(sentence: str) -> None:
    print(f"headway: {sentence}", file=sys.stderr)
    sys.exit(2)

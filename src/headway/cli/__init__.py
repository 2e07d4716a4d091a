"""The command line. What is typed wrongly gets one sentence on standard error and exit code 2."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence

import cyclopts
from cyclopts import App

from headway.cli import terminal
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
from headway.errors import HeadwayError, shorten
from headway.version import __version__

__all__ = ["app", "execute"]

app = App(
    name="headway",
    help="What happens to a disturbance as it travels down a platoon of vehicles, for this law, these delays, "
    "these parameters?",
    version=f"headway {__version__}",
    default_parameter=cyclopts.Parameter(negative=()),
    help_format="plaintext",
    suppress_keyboard_interrupt=False,  # `execute` says it
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


#: exit code of a command whose reader has gone, as a shell gives it for the signal
_BROKEN_PIPE = 141


def execute(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 a check failed, 2 refused, 130 interrupted, 141 nobody reads on."""
    try:
        with warnings.catch_warnings():
            terminal.prepare()
            result = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        terminal.flush()
    except cyclopts.CycloptsError as error:
        _fail(_plain(error))
    except HeadwayError as error:
        _fail(str(error))
    except KeyboardInterrupt:
        print("headway: interrupted", file=sys.stderr)
        sys.exit(130)
    except BrokenPipeError:
        terminal.hush(sys.stdout)
        sys.exit(_BROKEN_PIPE)
    except OSError as error:
        _fail(_unwritten(error))
    except MemoryError:
        _fail("there is not enough memory for this; ask for fewer points, vehicles, steps or results")
    except RecursionError:
        _fail("what was given is nested too deeply")
    sys.exit(result if isinstance(result, int) else 0)


def _unwritten(error: OSError) -> str:
    """A disk that is full, a place that cannot be written to."""
    where = error.filename or "standard output, or a file beside it,"
    return f"{where} cannot be written or read ({error.strerror or error})"


def _plain(error: cyclopts.CycloptsError) -> str:
    """A parser's message as one line, in plain words."""
    if isinstance(error, cyclopts.UnusedCliTokensError) and error.unused_tokens:
        return f"{shorten(error.unused_tokens[0])} is one argument too many here; see --help"
    text = " ".join(str(error).split()).rstrip(".")
    return text[:1].lower() + text[1:]


def _fail(sentence: str) -> None:
    try:
        terminal.flush()
    except (HeadwayError, BrokenPipeError):
        terminal.hush(sys.stdout)
    terminal.tell(str(HeadwayError(sentence)))
    sys.exit(2)

"""Bad input by the thousand: what must never end in a traceback, a hang or a half-written file.

Two attacks, both seeded: every option of every command with values of all kinds, and every ready scenario with
its fields changed. The tests run a few of each (`test_attack.py`); run many with

    python tests/helpers/attack.py --count 2000 [--only commands|scenarios] [--seed 1]
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import datetime
import inspect
import io
import os
import random
import signal
import sys
import tempfile
import traceback
import typing
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from headway.cli import app, execute
from headway.errors import LONGEST, HeadwayError
from headway.library import library, library_table
from headway.models import own
from headway.scenario.document import from_table

#: seconds after which an answer counts as a hang
PATIENCE = 20.0


class HangError(BaseException):
    """No answer in time."""


@dataclass
class Report:
    """How many attacks ended how, and the first of each kind that ended badly."""

    ends: Counter[str] = field(default_factory=Counter)
    bad: list[str] = field(default_factory=list)

    def add(self, end: str, what: object, why: str = "") -> None:
        """Count an end; all but a sentence and a success are bad."""
        self.ends[end] += 1
        if end not in ("sentence", "success"):
            self.bad.append(f"{end}: {what!r:.900} {why}")

    def __str__(self) -> str:
        return ", ".join(f"{n} {end}" for end, n in self.ends.most_common())


@contextlib.contextmanager
def alarm(seconds: float = PATIENCE) -> Iterator[None]:
    """Raise `HangError` after so many seconds."""

    def stop(*_: Any) -> None:
        raise HangError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds, 1.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def warm() -> None:
    """Compile what the attacks need, so that no answer waits for the compiler."""
    from headway.engine.simulate import simulate
    from headway.study.study import Study

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name in library():
            short = {**library_table(name), "duration": 2.0, "dt": 0.05, "output_step": 0.5}
            for scheme in ("rk4", "ballistic"):
                for limits in ([-8.0, 3.0], [-0.1, 0.1]):
                    followers = [{**follower, "lag": 0.1, "limits": limits} for follower in short["followers"]]
                    with contextlib.suppress(HeadwayError):
                        simulate(from_table({**short, "scheme": scheme, "followers": followers}))
            simulate(from_table(short))
        stops = {
            "duration": 20.0,
            "leader": {"kind": "brake", "mean": 15.0, "drop": 15.0, "hold": 5.0},
            "followers": [{"model": "idm", "count": 2, "delay": 0.3, "lag": 0.1}],
        }
        Study(from_table(stops), {"followers.0.delay": [0.2, 0.3]}).run(executor="serial")


# -- the command line ---------------------------------------------------------------------------------------------

_GOOD = """duration = 2.0
dt = 0.05
[leader]
kind = "sine"
mean = 23.0
amplitude = 1.0
omega = 0.63
[[followers]]
model = "idm"
count = 2
"""

_STUDY = _GOOD + "\n[axes]\n'leader.amplitude' = [0.5, 1.0]\n"

_TRIP = "time_s,vehicle,speed_mps,gap_m\n" + "".join(
    f"{t / 2},{n},{20 + t % 3},{'' if n == 0 else 30}\n" for t in range(40) for n in (0, 1)
)

_LAW = "import headway as hw\n@hw.model\ndef soft(s, v, dv, *, k=0.2):\n    return k * (s - 2 - v) + 0.5 * dv\n"

FILES = {
    "good.toml": _GOOD,
    "study.toml": _STUDY,
    "trip.csv": _TRIP,
    "soft.py": _LAW,
    "empty.toml": "",
    "bom.toml": "\ufeff" + _GOOD,
    "deep.toml": "a = " + "[" * 3000 + "]" * 3000,
    "deepkey.toml": "a" + ".a" * 100_000 + " = 1\n",
    "many.toml": _GOOD + "[[followers]]\nmodel = 'idm'\n" * 30_000,
    "digits.toml": _GOOD.replace("2.0", "9" * 5000, 1),
    "date.toml": _GOOD.replace("2.0", "1979-05-27", 1),
    "nested.toml": _GOOD.replace("23.0", "[[[[[1]]]]]"),
    "below.toml": _GOOD.replace("duration = 2.0\n", "") + "duration = 2.0\n",
    "binary.toml": b"\xff\xfe\x00\x01",
    "empty.csv": "",
    "words.csv": "time_s,vehicle,speed_mps,gap_m\na,b,c,d\n",
    "digits.csv": f"time_s,vehicle,speed_mps,gap_m\n0,0,{'9' * 400},\n1,0,3,\n",
    "binary.csv": b"\x00\x01\x02",
    "hole.csv": "Time,Speed1,Speed3,IVS1,IVS2\n0,10,10,20,20\n1,10,10,20,20\n",
    "endless.py": "while True:\n    pass\n",
    "exits.py": "import sys\nsys.exit(0)\n",
    "raises.py": "raise RuntimeError('no')\n",
    "syntax.py": "def (:\n",
    "nothing.py": "x = 1\n",
    "star.py": _LAW.replace("*, ", ""),
    "gap.py": _LAW.replace("(s, v", "(gap, v"),
    "root.py": _LAW.replace("import headway", "import math\nimport headway").replace("(s - 2", "(math.sqrt(s) - 2"),
    "prints.py": "print('side effect')\n" + _LAW,
    "loop.py": _LAW.replace("    return", "    while True:\n        pass\n    return"),
    "text.nc": "no NetCDF",
}

NUMBERS = (
    "nan", "inf", "-inf", "1e999", "-1", "0", "-0.0", "5e-324", "7e-307", "1e308", "1e30", "2147483648", "9" * 5000, "1_0",
    "٣", "", " ", "x", "1,2", "0x10", "1e", "true", "None", "[1]", "1:2", "0:0", "2:1", "nan:inf", "1e-9", "0.5",
)  # fmt: skip
NAMES = (
    "idm", "IDM", "imd", "kp", "", " ", "\0", "a\0b", "a" * 5000, "ü" * 300, "..", "/", ".", "/dev/null", "nowhere.toml",
    "nowhere.csv", "nowhere.py", "nowhere.py:soft", "soft.py:sofd", ":", "paper:", "paper:idm-22", "example:", "#", "=",
    "T=1", "T=nan", "T=", "=1", "T=1=2", "T==1", "s=1,dv", "s=nan", "zz=1", "-", "--", "\n", "\x1b[31m", "🚗", "a.b.c", "0/0",
    "3/2", "1/2", "serial", "dask://nowhere:1",
)  # fmt: skip
TARGETS = (
    "out.nc", "out.csv", "out.png", "out.svg", "out.toml", "out.gif", "out", "no/out.nc", "/dev/full", "/proc/out.nc",
    "/dev/full/out.nc", "folder.nc", "\0.nc", "a" * 300 + ".nc", "a" * 5000 + ".csv", "",
)  # fmt: skip
PATHS = (
    "duration", "dt", "output_step", "seed", "scheme", "gaps", "initial_speed", "leader", "leader.omega", "leader.kind",
    "leader.mean", "followers", "followers.0.delay", "followers.0.lag", "followers.0.count", "followers.0.parameters.T",
    "followers.0.model", "followers.0.limits", "followers.9.lag", "followers.x.lag", "followers.²", "kp", "T", "a.b.c",
    ".".join("a" * 40), "axes.leader", "gap_offsets", "gap_offsets.1",
)  # fmt: skip

#: what each command needs to get as far as an option that is attacked
BASES: dict[str, tuple[str, ...]] = {
    "run": ("good.toml",),
    "stability": ("idm", "--speed", "20"),
    "map": ("idm", "--x", "T=1:2:3", "--y", "speed=10:20:3"),
    "study": ("study.toml", "--executor", "serial"),
    "study status": ("nowhere.zarr",),
    "models": ("idm",),
    "check": ("soft.py",),
    "schema": (),
    "metrics": (),
    "data list": (),
    "data info": ("trip.csv",),
    "data fetch": ("us06",),
    "calibrate": ("idm", "trip.csv", "--fit", "T", "--seeds", "1"),
    "replay": ("trip.csv", "--model", "idm"),
    # these take long where they succeed: they are attacked with what must fail only
    "benchmark": ("nowhere.toml",),
    "paper": ("--only", "nothing"),
    "explore": ("nowhere.toml",),
}


def commands() -> dict[str, Any]:
    """Every command and its function, as the application knows them."""
    found: dict[str, Any] = {}
    for name in app:
        if name.startswith("-"):
            continue
        inner = app[name]
        if inner.default_command is not None:
            found[name] = inner.default_command
        for sub in inner:
            if not sub.startswith("-") and inner[sub].default_command is not None:
                found[f"{name} {sub}"] = inner[sub].default_command
    return found


def options(function: Any) -> list[tuple[str, str]]:
    """(option, kind of its values) of a command; positional arguments have the option ""."""
    hints = typing.get_type_hints(function, include_extras=True, localns={"Path": Path, "Any": Any})
    found = []
    for name, p in inspect.signature(function).parameters.items():
        hint = hints.get(name)
        named = next((m.name for m in getattr(hint, "__metadata__", ()) if getattr(m, "name", None)), None)
        option = (named[0] if isinstance(named, tuple) else named) or f"--{name.strip('_').replace('_', '-')}"
        text = str(hint)
        kind = "flag" if "bool" in text else "path" if "Path" in text and name in ("out", "csv", "figure") else "text"
        kind = "number" if "float" in text or "[int" in text or "'int" in text else kind
        kind = "set" if option == "--set" else kind
        found.append(("" if p.kind is p.POSITIONAL_OR_KEYWORD else option, kind))
    return found


def values(kind: str, random: random.Random) -> str:
    """A bad value of a kind, or sometimes a good one at the wrong place."""
    files = tuple(FILES)
    if kind == "set":
        path = random.choice(PATHS)
        return random.choice((f"{path}={random.choice(NUMBERS)}", f"{path}={random.choice(NAMES)}", path))
    if kind == "number":
        return random.choice(NUMBERS)
    if kind == "path":
        return random.choice(TARGETS)
    return random.choice(random.choice((NUMBERS, NAMES, files, TARGETS)))


def command_lines(seed: int, count: int) -> Iterator[list[str]]:
    """`count` command lines for each option of each command."""
    draw = random.Random(seed)
    for name, function in commands().items():
        base = list(BASES.get(name, ()))
        for option, kind in options(function):
            for _ in range(count):
                value = values(kind, draw)
                if kind == "flag":
                    words = [*base, f"{option}={value}"]
                elif option:
                    words = [
                        *base,
                        f"{option}={value}" if draw.random() < 0.7 else option,
                        *([value] * (draw.random() < 0.9)),
                    ]
                elif name in ("benchmark", "paper", "explore"):
                    words = [f"nowhere{value}"]
                else:
                    words = [value, *base[1:]]
                yield [*name.split(), *words]
            if name in ("schema", "data list", "metrics"):
                break


def attack_command(arguments: list[str], report: Report) -> None:
    """Run a command line in this process and judge its end."""
    out, err = io.TextIOWrapper(io.BytesIO(), "utf-8"), io.TextIOWrapper(io.BytesIO(), "utf-8")
    before = set(os.listdir("."))
    try:
        with alarm(), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            execute(arguments)
    except SystemExit as end:
        err.flush()
        lines = err.buffer.getvalue().decode().splitlines()  # type: ignore[attr-defined]  # it is bytes
        said = [x for x in lines if x.startswith("headway: ") and not x.startswith("headway: note: ")]
        if end.code not in (0, 1, 2):
            report.add("exit code", arguments, str(end.code))
        elif end.code == 2 and (len(said) != 1 or len(said[0]) > LONGEST + len("headway: ")):
            report.add("unreadable", arguments, "\n".join(lines)[:500])
        else:
            report.add("sentence" if end.code == 2 else "success", arguments)
        code = end.code
    except HangError:
        report.add("hang", arguments)
        code = None
    except BaseException:
        report.add("traceback", arguments, traceback.format_exc()[-900:])
        code = None
    left = {n for n in set(os.listdir(".")) - before if n != "__pycache__"}
    if any(n.startswith(".") for n in left) or (left and code == 2):
        report.add("half-written", arguments, str(left))
    for name in left:
        place = Path(name)
        if place.is_file():
            place.unlink()


def attack_commands(seed: int, count: int) -> Report:
    """`count` bad values for every option of every command, in a folder of their own."""
    warm()
    report, here = Report(), os.getcwd()
    patience, own._PATIENCE = own._PATIENCE, 1.0
    with tempfile.TemporaryDirectory() as place:
        for name, content in FILES.items():
            (Path(place) / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        (Path(place) / "folder.nc").mkdir()
        os.chdir(place)
        try:
            for arguments in command_lines(seed, count):
                attack_command(arguments, report)
        finally:
            os.chdir(here)
            own._PATIENCE = patience
    return report


# -- scenarios ----------------------------------------------------------------------------------------------------

VALUES: tuple[Any, ...] = (
    None, True, "", "x", "nan", [], {}, [1], [1, "x"], [[1]], {"a": 1}, float("nan"), float("inf"), -float("inf"), 0, -1,
    1e308, -1e308, 5e-324, 7e-307, 1e-12, 1e30, 1e9, 2147483648, 10**400, -(10**25), 1e-3, 0.5, 3, 1000.0,
    datetime.date(1979, 5, 27), datetime.datetime(1979, 5, 27), datetime.time(7, 32), 1 + 2j, b"x", object, (1, 2),
    {"s": float("nan")}, {"s": 1e30}, {"1": 1e30}, {"1": None}, "idm", "sine", "ballistic", "a" * 5000, "\0",
)  # fmt: skip


def places(table: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of everything in a table."""
    found = [path] if path else []
    entries = table.items() if isinstance(table, dict) else enumerate(table) if isinstance(table, list) else ()
    for key, value in entries:
        found += places(value, (*path, key))
    return found


def mutated(table: dict[str, Any], draw: random.Random) -> dict[str, Any]:
    """A ready scenario with one to three things changed; what is not changed makes it short."""
    table = copy.deepcopy(table)
    table["duration"] = min(2.0, float(table.get("duration") or 2.0))
    table["dt"] = 0.05
    table.pop("output_step", None)
    for key, value in (("delay", 0.1), ("lag", 0.1), ("limits", [-8.0, 3.0]), ("length", 5.0)):
        for follower in table["followers"] if draw.random() < 0.3 else ():
            follower.setdefault(key, value)
    for key in (
        "scheme",
        "seed",
        "gaps",
        "initial_speed",
        "gap_offsets",
        "speed_offsets",
        "leader_length",
        "output_step",
    ):
        if draw.random() < 0.05:
            table[key] = draw.choice(VALUES)
    for _ in range(draw.choice((1, 1, 2, 3))):
        *parents, last = draw.choice(places(table))
        spot: Any = table
        for key in parents:
            spot = spot[key]
        kind = draw.random()
        if kind < 0.05:
            del spot[last]
        elif kind < 0.6 and type(spot[last]) in (float, int) and abs(spot[last]) < 1e300:
            spot[last] = spot[last] * 10.0 ** draw.randint(-8, 8)
        else:
            spot[last] = copy.deepcopy(draw.choice(VALUES))
        if not table:
            break
    return table


def attack_scenario(table: dict[str, Any], name: str, report: Report) -> None:
    """Build and simulate a table and judge the end."""
    from headway.engine.simulate import simulate

    try:
        with alarm(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            simulate(from_table(table))
        report.add("success", name)
    except HeadwayError as error:
        text = str(error)
        good = text.isprintable() and 10 < len(text) <= LONGEST
        report.add("sentence" if good else "unreadable", (name, text))
    except HangError:
        report.add("hang", (name, {k: v for k, v in table.items() if k != "description"}))
    except BaseException:
        report.add(
            "traceback", (name, {k: v for k, v in table.items() if k != "description"}), traceback.format_exc()[-900:]
        )


def attack_scenarios(seed: int, count: int, names: typing.Iterable[str] | None = None) -> Report:
    """`count` mutations of every ready scenario."""
    warm()
    report = Report()
    os.environ["HEADWAY_LIMIT"] = "0.1"  # what is allowed by default may take a minute
    for name in names if names is not None else library():
        draw, table = random.Random(f"{seed} {name}"), library_table(name)
        for _ in range(count):
            attack_scenario(mutated(table, draw), name, report)
    del os.environ["HEADWAY_LIMIT"]
    return report


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=2000, help="mutations of each ready scenario")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=("commands", "scenarios"))
    chosen = parser.parse_args()
    reports = []
    if chosen.only != "scenarios":
        reports.append(("commands", attack_commands(chosen.seed, max(1, chosen.count // 50))))
    if chosen.only != "commands":
        reports.append(("scenarios", attack_scenarios(chosen.seed, chosen.count)))
    for title, told in reports:
        print(f"{title}: {sum(told.ends.values())} attacks: {told}")
        for line in told.bad[:40]:
            print("   ", line)
    sys.exit(any(told.bad for _, told in reports))

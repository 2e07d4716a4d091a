"""What is typed as text, and what is shown of shared options."""

from __future__ import annotations

import typing
from collections import defaultdict
from pathlib import Path

import pytest
from attack import commands, options

from headway.cli import parse
from headway.errors import HeadwayError


@pytest.mark.parametrize(("call", "value"), [
    (lambda: parse.axis_range("--x", "T=0.5:2.5"), ("T", (0.5, 2.5))),
    (lambda: parse.axis_range("--x", " T =1:2:30"), ("T", (1.0, 2.0, 30.0))),
    (lambda: parse.window("--window", "0:200"), (0.0, 200.0)),
    (lambda: parse.ranges("--bound", ["T=0.5:3", "delay=0:1"]), {"T": (0.5, 3.0), "delay": (0.0, 1.0)}),
    (lambda: parse.ranges("--bound", None), {}),
    (lambda: parse.shard("3/16"), (3, 16)), (lambda: parse.shard(""), None),
    (lambda: parse.names("C05, idm-1,", "C06"), ["C05", "idm-1", "C06"]),
    (lambda: parse.delay("0.5"), 0.5), (lambda: parse.delay("s=0.5,dv=1"), {"s": 0.5, "dv": 1.0}),
])  # fmt: skip
def test_texts(call, value):
    assert call() == value


@pytest.mark.parametrize("call", [
    *(lambda text=text: parse.axis_range("--x", text)
      for text in ("", "T", "T=", "T=1", "T=1:", "T=1:x", "T=1:2:3:4", "T=1:2:2.5", "T=1:2:nan", "T=1_0:2")),
    *(lambda text=text: parse.shard(text) for text in ("3", "/", "3/", "a/b", "-1/2", "²/3", "1/" + "9" * 5000)),
    *(lambda text=text: parse.window("--window", text) for text in ("", "1", "1:2:3", "a:b", "nan:1", "0:inf")),
    *(lambda text=text: parse.ranges("--bound", [text]) for text in ("T", "T=1", "=1:2", "T=1:2:3")),
])  # fmt: skip
def test_other_texts_get_a_sentence(call):
    with pytest.raises(HeadwayError, match=r"^--\w+ .*write "):
        call()


def test_an_option_of_several_commands_takes_the_same_kind_of_values():
    kinds = defaultdict(set)
    for function in commands().values():
        for option, kind in options(function):
            if option:
                kinds[option].add(kind)
    assert {option: found for option, found in kinds.items() if len(found) > 1} == {}


@pytest.mark.parametrize("name", ["set_", "model", "delay", "lag", "gap", "json", "column", "unit", "metrics"])
def test_shared_options_are_written_once(name):
    hints = []
    for command, function in commands().items():
        own = typing.get_type_hints(function, include_extras=True, localns={"Path": Path, "Any": typing.Any})
        if name in own and not (command in ("calibrate", "replay") and name in ("model", "delay")):
            hints.append(str(own[name]))
    assert len(hints) > 1
    assert len(set(hints)) <= (4 if name == "set_" else 1)

"""A few of the attacks of `attack.py`; `python tests/helpers/attack.py --count 2000` runs them by the thousand."""

from __future__ import annotations

import os

from attack import attack_commands, attack_scenarios, commands, options

#: how many times as many: HEADWAY_ATTACKS=10 for ten times
TIMES = int(os.environ.get("HEADWAY_ATTACKS", "1"))


def test_every_option_of_every_command_answers_bad_values():
    assert len(commands()) >= 15
    assert sum(len(options(f)) for f in commands().values()) > 100
    report = attack_commands(seed=1, count=TIMES)
    assert not report.bad, "\n".join(report.bad[:5])
    assert report.ends["sentence"] > 0.8 * sum(report.ends.values())


def test_changed_scenarios_run_or_are_refused():
    report = attack_scenarios(seed=2, count=6 * TIMES)
    assert not report.bad, "\n".join(report.bad[:5])
    assert min(report.ends["sentence"], report.ends["success"]) > 0.05 * sum(report.ends.values())

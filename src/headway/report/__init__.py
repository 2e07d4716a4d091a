"""A report: text, tables and figures on one page that needs nothing beside it and no network.

    from headway import report

    page = report.Report("Title", ("What matters most.",), (report.Section("One", (report.Text(("Words.",)),)),))
    report.write(page, "out/report")

A report does not depend on simulations: its author brings words, numbers and figures.
"""

from __future__ import annotations

from headway.report.parts import Block, Illustration, Report, Section, Table, Text
from headway.report.writing import write

__all__ = ["Block", "Illustration", "Report", "Section", "Table", "Text", "write"]

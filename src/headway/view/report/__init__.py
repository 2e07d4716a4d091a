"""A report: text, tables and figures on one page that needs nothing beside it and no network.

    from headway.view import report

    page = report.Report("Title", ("What matters most.",), (report.Section("One", (report.Text(("Words.",)),)),))
    report.write(page, "out/report")

A report knows nothing of simulations: who writes one brings words, numbers and figures.
"""

from __future__ import annotations

from headway.view.report.parts import Block, Picture, Report, Section, Table, Text
from headway.view.report.writing import write

__all__ = ["Block", "Picture", "Report", "Section", "Table", "Text", "write"]

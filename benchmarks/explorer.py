"""The explorer in a browser: from the hand to the picture, from the start to the first picture, and memory.

20 vehicles for 60 s with one delay. A pointer drags a slider; the page notes for every answer how long it took from
the input event until the frame with the new curves had been handed over (`performance.measure`), and the server's
share of it. Needs a Chromium on the PATH, or one of playwright's own.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import sys
import time
from typing import Any

MOVES, MANY = 300, 10_000

#: collects what the page measures of itself
_COLLECT = """() => {
  window.seen = [];
  const measure = performance.measure.bind(performance);
  performance.measure = (...given) => {
    const found = measure(...given);
    window.seen.push([found.duration, found.detail.engine]);
    return found;
  };
}"""

#: moves a slider again and again, each time when the last picture stands
_MANY = """async (count) => {
  const slider = document.querySelector('input[data-field="T"]');
  for (let i = 0; i < count; i++) {
    const before = window.seen.length;
    slider.value = 400 + 60 * Math.sin(i / 9);
    slider.dispatchEvent(new Event("input", { bubbles: true }));
    const late = performance.now() + 5000;
    while (window.seen.length === before && performance.now() < late) await new Promise((done) => setTimeout(done, 1));
    if (window.seen.length > 1000) window.seen.splice(0, 500);
  }
}"""


def main() -> int:
    """Measure and print; 1 where a goal of the project is missed."""
    from playwright.sync_api import sync_playwright

    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        _first_picture(browser)  # fills the caches
        start = _first_picture(browser)
        server, url = _start()
        try:
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            page.goto(url)
            page.wait_for_selector("#map[data-points='110']", timeout=60_000)
            page.evaluate(_COLLECT)
            worst, share = 0.0, 0.0
            for name in ("T", "delay"):
                total, engine = zip(*_drag(page, name), strict=True)
                worst, share = max(worst, _percentile(total, 95)), max(share, _percentile(engine, 95))
                print(f"slider {name:<6} {len(total)} pictures: {_three(total)}; of it the server {_three(engine)}")
            heap, resident = _memory(page, server.pid), []
            for _ in range(4):
                page.evaluate(_MANY, MANY // 4)
                resident.append(_memory(page, server.pid))
        finally:
            server.terminate()
            server.wait(10)
        browser.close()
    print(f"start to first picture, warm: {start:.2f} s (goal: below 3 s)")
    print(f"hand to picture p95 {worst:.1f} ms (goal: below 50 ms), server p95 {share:.1f} ms (goal: below 10 ms)")
    row = ", ".join(f"{server:.0f}/{page:.1f}" for server, page in (heap, *resident))
    print(f"server/page memory [MB] after 0 … {MANY} moves: {row}")
    return int(start >= 3.0 or worst >= 50.0 or share >= 10.0)


def _start() -> tuple[subprocess.Popen[str], str]:
    command = [sys.executable, "-m", "headway", "explore", "--no-browser"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert server.stdout is not None
    return server, server.stdout.readline().split()[-1]


def _first_picture(browser: Any) -> float:
    """Seconds from starting the command until the first curves are painted."""
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    begun = time.perf_counter()
    server, url = _start()
    try:
        page.goto(url)
        page.wait_for_selector("#timing:not(:empty)", timeout=60_000)
        return time.perf_counter() - begun
    finally:
        page.close()
        server.terminate()
        server.wait(10)


def _drag(page: Any, name: str) -> list[list[float]]:
    """[total, server] in milliseconds of every picture while a pointer drags a slider."""
    slider = page.locator(f"input[data-field='{name}']")
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    left, y = box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"]
    page.mouse.move(left, y)
    page.mouse.down()
    page.evaluate("window.seen.length = 0")
    for i in range(MOVES):
        page.mouse.move(left + 0.4 * box["width"] * (0.5 - 0.5 * math.cos(i / 20)), y)
        page.wait_for_timeout(25)
    page.mouse.up()
    page.wait_for_timeout(500)
    return page.evaluate("window.seen")


def _memory(page: Any, process: int) -> tuple[float, float]:
    """Resident memory of the server and heap of the page, in megabytes."""
    with open(f"/proc/{process}/status") as status:
        kilobytes = next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))
    session = page.context.new_cdp_session(page)
    session.send("HeapProfiler.collectGarbage")
    heap = session.send("Runtime.getHeapUsage")["usedSize"]
    session.detach()
    return kilobytes / 1024, heap / 2**20


def _percentile(values: Any, share: int) -> float:
    return sorted(values)[min(len(values) - 1, math.ceil(len(values) * share / 100))]


def _three(values: Any) -> str:
    return f"median {_percentile(values, 50):.1f}, p95 {_percentile(values, 95):.1f}, most {max(values):.1f} ms"

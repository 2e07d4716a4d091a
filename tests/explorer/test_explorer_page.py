"""The explorer's page in a headless browser, with a real pointer and real keys."""

from __future__ import annotations

import json
import os
import time
from concurrent.futures import CancelledError
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

import headway as hw
from headway.explorer import session
from headway.explorer import state as states
from headway.explorer.controls import controls
from headway.explorer.picture import Quick, draw

SCENARIO = """duration = 30
[leader]
kind = "sine"
mean = 23
amplitude = 2
omega = 0.63
[[followers]]
model = "idm"
count = 6
delay = 0.3
parameters = { T = 1.2 }
"""

#: all that a run draws, as one text that changes when any of it does
DRAWN = (
    "[...document.querySelectorAll('#speed canvas, #spacing canvas, #space canvas')].map((c) => c.toDataURL()).join()"
)


@pytest.fixture(scope="module")
def browser():
    from chromium import find
    from playwright.sync_api import Error, sync_playwright

    path = find()
    if path is None:
        without("there is no Chromium on this machine; python tools/chromium.py installs it")
    with sync_playwright() as playwright:
        try:
            running = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        except Error as error:
            without(f"Chromium does not start here: {error.message.splitlines()[0]}")
        yield running
        running.close()


def without(reason: str) -> NoReturn:
    """Skip the page's tests, or fail them where the environment requires a browser."""
    if os.environ.get("HEADWAY_REQUIRE_BROWSER", "0") != "0":
        pytest.fail(f"{reason} (HEADWAY_REQUIRE_BROWSER is set, so the page has to be tested)", pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="module")
def explorer():
    scenario = hw.from_toml(SCENARIO)
    # what is compiled once on a machine takes longer than any page is waited for
    draw(states.checked_state(states.start_state(scenario)), Quick(), 300, draft=True, stale=lambda: False)
    with hw.explore(scenario, browser=False) as running:
        yield running


@pytest.fixture(scope="module")
def context(browser):
    with browser.new_context(accept_downloads=True) as context:
        yield context


@pytest.fixture
def open_page(context, explorer):
    """Opens the page; at the end nothing may have been on the console or asked of another machine."""
    noise, pages = [], []

    def opening(fragment: str = "", **options):
        page = context.new_page()
        pages.append(page)
        page.set_viewport_size({"width": options.get("width", 1100), "height": 800})
        page.emulate_media(color_scheme=options.get("scheme", "light"))
        page.on("console", lambda message: noise.append(message.text))
        page.on("pageerror", lambda error: noise.append(str(error)))
        allowed = (explorer.url, explorer.url.replace("http", "ws"), "data:", "blob:")
        page.on("request", lambda r: r.url.startswith(allowed) or noise.append(r.url))
        page.on("websocket", lambda w: w.url.startswith(allowed) or noise.append(w.url))
        page.goto(explorer.url + fragment)
        page.wait_for_selector("#timing:not(:empty)")
        return page

    yield opening
    for page in pages:
        page.close()
    assert noise == []


def until(page, condition, what=""):
    """Wait for a condition in JavaScript (the page's own rules forbid playwright's way of evaluating it)."""
    for _ in range(500):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(10)
    raise AssertionError(f"never {what}: {condition}")


def settled(page):
    """Wait for the exact run and everything after it."""
    page.wait_for_selector("#verdict:not(.old) p")
    page.wait_for_selector("#map[data-points='110']")


def state_of(page):
    """The state in the page's address, which follows within a moment."""
    page.wait_for_timeout(350)
    return states.decode(page.url)


def drag(page, slider, share):
    """Drag a slider from where it stands to a share of its way."""
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    knob, way = 16, box["width"] - 16
    now = float(slider.input_value()) / 1000
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + knob / 2 + now * way, y)
    page.mouse.down()
    page.mouse.move(box["x"] + knob / 2 + share * way, y, steps=3)
    page.mouse.up()


def test_each_slider_moves_the_curves(open_page):
    page = open_page()
    settled(page)
    page.click("summary:has-text('Run')")
    names = page.eval_on_selector_all("input[data-field]", "(all) => all.map((s) => s.dataset.field)")
    idm = [p.name for p in hw.models.IDM.parameters.values()]
    expected = ["count", "lag", "length", *idm, "delay", "mean", "amplitude", "omega", "duration"]
    assert names == expected
    for name in names:
        slider = page.locator(f"input[data-field='{name}']")
        said = slider.get_attribute("aria-valuetext")
        page.evaluate(f"window.before = {DRAWN}")
        now = float(slider.input_value()) / 1000
        drag(page, slider, 0.35 if now < 0.1 else now + (0.08 if name != "omega" else -0.1))
        until(page, f"window.before !== {DRAWN}", name)
        assert slider.get_attribute("aria-valuetext") != said, name
        assert page.is_hidden("#error"), (name, page.text_content("#error"))
    scenario = states.checked_state(state_of(page)).scenario
    assert len(scenario.followers) != 6
    assert all(value != hw.models.IDM().parameters[n] for n, value in scenario.followers[0].model.items)


def test_keys_move_a_slider_and_start_the_platoon(open_page):
    page = open_page()
    slider = page.locator("input[data-field='T']")
    slider.focus()
    before = float(slider.input_value())
    page.keyboard.press("ArrowRight")
    assert float(slider.input_value()) == before + 1
    page.locator("#controls").focus()
    page.keyboard.press("Space")
    assert page.get_attribute("#play", "aria-pressed") == "true"
    until(page, "parseFloat(document.querySelector('#clock').value) > 0.3")
    page.keyboard.press("Space")
    assert page.get_attribute("#play", "aria-pressed") == "false"
    # every control has a name that is read out
    unnamed = page.evaluate(
        "[...document.querySelectorAll('input, select, button')].filter((e) => !(e.labels?.length || e.ariaLabel "
        "|| e.getAttribute('aria-label') || e.textContent.trim())).map((e) => e.outerHTML)"
    )
    assert unnamed == []


def test_scrubbing_in_a_chart_sets_the_time(open_page):
    page = open_page()
    box = page.locator("#speed canvas").bounding_box()
    page.mouse.click(box["x"] + 44 + 0.5 * (box["width"] - 54), box["y"] + 60)
    assert page.input_value("#scrub") == "500"
    assert page.evaluate("document.querySelector('#clock').value") == "15.0 s"


def test_a_click_on_the_map_goes_there(open_page):
    page = open_page()
    settled(page)
    over = page.locator("#map .over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    (x, x0, x1), (y, y0, y1) = states.start_state(hw.from_toml(SCENARIO))["map"]
    page.mouse.click(box["x"] + 0.25 * box["width"], box["y"] + 0.25 * box["height"])
    group = state_of(page)["scenario"]["followers"][0]
    assert (x, y) == ("T", "delay")
    assert group["parameters"]["T"] == pytest.approx(x0 + 0.25 * (x1 - x0), abs=0.02)
    assert group["delay"] == pytest.approx(y0 + 0.75 * (y1 - y0), abs=0.02)
    assert (
        page.locator("input[data-field='T']")
        .get_attribute("aria-valuetext")
        .startswith(f"{group['parameters']['T']:g}")
    )
    over.focus()
    page.keyboard.press("ArrowUp")
    assert state_of(page)["scenario"]["followers"][0]["delay"] == pytest.approx(
        group["delay"] + 0.02 * (y1 - y0), abs=1e-3
    )


def test_a_newer_state_overtakes_one_that_takes_long(open_page, monkeypatch):
    """The page does not wait for the picture of a state that the hand has left; the engine gives that up."""
    given_up = []

    def draw_slowly(state, quick, points, draft, stale):
        if state.scenario.followers[0].delay == 1.2:
            end = time.perf_counter() + 20.0  # as long as stop and go once took
            while time.perf_counter() < end:
                if stale():
                    given_up.append(state)
                    raise CancelledError
                time.sleep(0.01)
        return draw(state, quick, points, draft, stale)

    monkeypatch.setattr(session, "draw", draw_slowly)
    page = open_page()
    settled(page)
    field = page.get_by_label("delay, exact value")
    field.fill("1.2")
    field.press("Enter")
    page.wait_for_timeout(1000)
    page.evaluate(f"window.before = {DRAWN}")
    begun = time.perf_counter()
    field.fill("0.2")
    field.press("Enter")
    until(page, f"window.before !== {DRAWN}", "the newer state's curves")
    took = time.perf_counter() - begun
    assert given_up
    assert took < 5.0, took
    settled(page)  # and the session goes on


def test_the_page_says_what_headway_stability_says(open_page, cli, tmp_path):
    page = open_page()
    drag(page, page.locator("input[data-field='delay']"), 0.9)
    until(page, "document.querySelector('#badge').dataset.word === 'string unstable'")
    page.wait_for_timeout(200)
    settled(page)
    file = tmp_path / "sc.toml"
    file.write_text(states.checked_state(state_of(page)).scenario.to_toml())
    _, out, _ = cli("stability", file)
    assert page.eval_on_selector_all("#verdict p", "(all) => all.map((p) => p.textContent)") == out.splitlines()


def test_a_pinned_run_stays_beside_the_next_and_in_the_address(open_page):
    page = open_page()
    settled(page)
    page.click("#pin")
    assert page.get_attribute("#pin", "aria-pressed") == "true"
    drag(page, page.locator("input[data-field='a']"), 0.2)
    page.wait_for_timeout(300)
    settled(page)
    both = page.eval_on_selector_all(
        "#figures tbody tr", "(all) => all.map((r) => [...r.cells].map((c) => c.textContent))"
    )
    assert any(row[1] != row[2] for row in both)
    found = state_of(page)
    assert found["pinned"]["followers"][0]["parameters"]["a"] == 1.0
    assert found["scenario"]["followers"][0]["parameters"]["a"] != 1.0
    again = open_page("#" + states.encode(found))
    settled(again)
    again.wait_for_selector("#figures.compares")
    same = again.eval_on_selector_all(
        "#figures tbody tr", "(all) => all.map((r) => [...r.cells].map((c) => c.textContent))"
    )
    assert same == both
    again.keyboard.press("p")
    assert "pinned" not in state_of(again)


def test_the_address_restores_everything(open_page):
    sc = hw.Scenario(
        hw.brake(mean=20, drop=6, hold=4),
        [hw.Vehicle(hw.models.CACC(h=0.7), delay={"vl": 0.2, "al": 0.2}, lag=0.1)] * 3
        + [hw.Vehicle(hw.models.IDM())] * 2,
        duration=40,
    )
    state = states.start_state(sc)
    page = open_page("#" + states.encode(state))
    settled(page)
    assert page.locator("input[data-field='h']").get_attribute("aria-valuetext") == "0.7 s"
    assert page.locator("input[data-field='al']").get_attribute("aria-valuetext") == "0.2 s"
    drag(page, page.locator("input[data-field='drop']"), 0.7)
    found = state_of(page)
    assert found["scenario"]["leader"]["drop"] != 6
    found["scenario"]["leader"]["drop"] = 6.0
    assert states.checked_state(found).scenario == sc
    # an address that is pasted into the open page
    page.evaluate(f"location.hash = {states.encode(states.start_state(hw.from_toml(SCENARIO)))!r}")
    page.wait_for_selector("input[data-field='T']")
    settled(page)
    assert states.checked_state(state_of(page)).scenario == hw.from_toml(SCENARIO)


def test_exports_hold_what_is_shown(open_page):
    page = open_page()
    settled(page)
    drag(page, page.locator("input[data-field='T']"), 0.55)
    settled(page)
    scenario = states.checked_state(state_of(page)).scenario
    files = {}
    for button in ("TOML", "CSV", "Python", "PNG"):
        with page.expect_download() as download:
            page.get_by_role("button", name=button, exact=True).click()
        files[button] = Path(download.value.path()).read_bytes()
    assert hw.from_toml(files["TOML"].decode()) == scenario
    space: dict = {}
    exec(files["Python"].decode(), space)
    assert space["sc"] == scenario
    lines = files["CSV"].decode().splitlines()
    assert lines[0].startswith("time [s],vehicle,position [m]")
    assert len(lines) == 1 + space["tr"].sizes["vehicle"] * space["tr"].sizes["time"]
    last = np.array([float(v or "nan") for v in lines[-1].split(",")])
    assert last[2] == space["tr"].position.values[-1, -1]
    assert files["PNG"][:4] == b"\x89PNG"
    assert len(files["PNG"]) > 20_000


def test_every_law_and_leader_can_be_chosen(open_page):
    told = controls()
    page = open_page()

    def choose(label, name):
        page.evaluate(f"window.before = {DRAWN}")
        page.get_by_label(label, exact=True).select_option(name)
        until(page, f"window.before !== {DRAWN}", name)
        assert page.is_hidden("#error"), (name, page.text_content("#error"))

    for kind in [k for k in told["kinds"] if k not in ("recorded", "sine")]:
        choose("kind", kind)
    assert states.checked_state(state_of(page)).scenario.leader.kind == kind
    choose("kind", "sine")
    for law in [name for name in told["models"] if name != "idm"]:
        choose("model", law)
    assert states.checked_state(state_of(page)).scenario.followers[0].model.name == law
    settled(page)


def test_a_mix_of_vehicles(open_page):
    page = open_page()
    page.get_by_label("Add a group behind").click()
    page.get_by_label("model", exact=True).select_option("fvdm")
    page.get_by_label("late", exact=True).select_option("alone")
    settled(page)
    followers = states.checked_state(state_of(page)).scenario.followers
    assert [f.model.name for f in followers] == ["idm"] * 6 + ["fvdm"]
    assert followers[-1].delay == (("s", 0.3), ("v", 0.3), ("vl", 0.3))
    page.get_by_label("Remove this group").click()
    page.wait_for_timeout(50)
    assert len(states.checked_state(state_of(page)).scenario.followers) == 6


def test_what_cannot_be_run_is_said_and_the_last_picture_stays(open_page):
    page = open_page()
    field = page.get_by_label("mean, exact value")
    field.fill("40")
    field.press("Enter")
    page.wait_for_selector("#error:not([hidden])")
    assert "cannot start in equilibrium" in page.text_content("#error")
    field.fill("21")
    field.press("Enter")
    page.wait_for_selector("#error", state="hidden")


def test_a_wrong_token_is_refused(browser, explorer):
    page = browser.new_page()
    answer = page.goto(explorer.url[:-3] + "xx/")
    assert answer.status == 403
    assert "token" in page.text_content("body")
    # a page of another origin gets no connection even with the token
    knock = """(url) => new Promise((done) => {
      const socket = new WebSocket(url);
      socket.onopen = () => done(false);
      socket.onerror = () => done(true);
    })"""
    elsewhere = explorer.url.replace("http", "ws").replace("127.0.0.1", "localhost") + "ws"
    refused = page.evaluate(knock, elsewhere)
    assert refused
    page.close()


@pytest.mark.parametrize(("width", "scheme"), [(390, "dark"), (1440, "light")])
def test_it_fits_the_screen_in_both_colours(open_page, width, scheme):
    page = open_page(width=width, scheme=scheme)
    settled(page)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (sum(json.loads(ground.replace("rgb(", "[").replace(")", "]"))) < 200) == (scheme == "dark")

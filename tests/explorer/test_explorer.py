"""The explorer's server: who may use it, what it refuses, what it answers, and that it never ends."""

from __future__ import annotations

import contextlib
import json
import math
import re
import socket
import struct
import time
from concurrent.futures import CancelledError

import numpy as np
import pytest

import headway as hw
from headway.engine.simulate import solve
from headway.errors import HeadwayError
from headway.explorer import answers, exports, picture
from headway.explorer import state as states
from headway.explorer.lines import python_lines
from headway.explorer.server import make_app
from headway.theory.sentences import vehicle_verdict

TOKEN = "a-token"
HERE = "http://127.0.0.1:8000"
BASE = """duration = 30
[leader]
kind = "sine"
mean = 23
amplitude = 2
omega = 0.63
[[followers]]
model = "idm"
count = 4
delay = 0.3
parameters = { T = 1.2 }
"""


def never() -> bool:
    return False


@pytest.fixture
def state():
    return states.start_state(hw.from_toml(BASE))


@pytest.fixture
def client(state):
    from starlette.testclient import TestClient

    with TestClient(make_app(TOKEN, state), base_url=HERE) as client:
        yield client


def connect(client, token=TOKEN, **headers):
    return client.websocket_connect(f"ws://127.0.0.1:8000/{token}/ws", headers={"origin": HERE, **headers})


def ask(state, number=1, **more):
    return json.dumps({"do": "show", "id": number, "points": 200, "state": state, **more})


def unpack(data: bytes):
    (length,) = struct.unpack_from("<I", data)
    header, at = json.loads(data[4 : 4 + length]), 4 + length
    arrays = {}
    for name, shape in header["arrays"]:
        size = int(np.prod(shape))
        arrays[name] = np.frombuffer(data, "<f4", size, at).reshape(shape)
        at += 4 * size
    assert at == len(data)
    return header, arrays


def receive(link):
    """The next message: (header or table, arrays)."""
    message = link.receive()
    if message.get("bytes"):
        return unpack(message["bytes"])
    return json.loads(message["text"]), {}


def until(link, kind, number):
    """The first message of a kind about a request; what came before it is passed over."""
    while True:
        header, arrays = receive(link)
        if header["kind"] == kind and header["id"] == number:
            return header, arrays
        assert header["kind"] != "error", header


# -- who may use it ----------------------------------------------------------------------------------


@pytest.mark.parametrize("path", ["", "app.js", "plotly.min.js", "hello"])
def test_page_and_scripts_need_the_token(client, path):
    good = client.get(f"/{TOKEN}/{path}")
    assert good.status_code == 200
    assert "script-src 'self'" in good.headers["content-security-policy"]
    assert good.headers["referrer-policy"] == "no-referrer"
    for wrong in ("", "/", f"/wrong/{path}", f"/{TOKEN}x/{path}", f"/{path}"):
        assert client.get(wrong).status_code == 403


def test_only_the_files_of_the_page_are_given(client):
    for path in ("nothing.js", "..%2Fserver.py", "%2e%2e/server.py", "static/app.js"):
        assert client.get(f"/{TOKEN}/{path}").status_code in (403, 404)


@pytest.mark.parametrize("host", ["evil.example:8000", "127.0.0.1", "127.0.0.1:9", ""])
def test_another_host_name_is_refused(client, host):
    from starlette.websockets import WebSocketDisconnect

    assert client.get(f"/{TOKEN}/", headers={"host": host}).status_code == 403
    with pytest.raises(WebSocketDisconnect), connect(client, host=host):
        pass


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:9", "https://127.0.0.1:8000"])
def test_another_origin_is_refused(client, origin, state):
    from starlette.websockets import WebSocketDisconnect

    refused = client.post(f"/{TOKEN}/export/toml", content=json.dumps(state), headers={"origin": origin})
    assert refused.status_code == 403
    with pytest.raises(WebSocketDisconnect), connect(client, origin=origin):
        pass


def test_a_websocket_without_origin_or_token_is_refused(client):
    from starlette.websockets import WebSocketDisconnect

    with pytest.raises(WebSocketDisconnect), client.websocket_connect(f"ws://127.0.0.1:8000/{TOKEN}/ws"):
        pass
    with pytest.raises(WebSocketDisconnect), connect(client, token="wrong"):
        pass


def test_it_listens_on_this_machine_only_with_a_new_token_each_time():
    sc = hw.from_toml(BASE)
    with hw.explore(sc, browser=False) as one, hw.explore(sc, browser=False) as two:
        assert one.url != two.url
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/[\w-]{20,}/", one.url)
        with pytest.raises(HeadwayError, match=f"port = {one.port}: the explorer cannot listen"):
            hw.explore(sc, browser=False, port=one.port)
    with pytest.raises(OSError, match="refused"):
        socket.create_connection(("127.0.0.1", one.port), timeout=1)


# -- what is beyond it -------------------------------------------------------------------------------


def leader(**fields):
    return {"leader": {"kind": "square", "mean": 20.0, "amplitude": 1.0, "omega": 1.0, **fields}}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            {"followers": [{"model": "idm", "count": 201}]},
            "201 vehicles are too many for the explorer, which takes 200",
        ),
        ({"followers": [{"model": "idm", "count": 150}] * 2}, "300 vehicles are too many"),
        ({"followers": [{"model": "idm", "count": 10**12}]}, "too many"),
        ({"duration": 1e5}, "duration = 100000 s is too long for the explorer, which takes 3600 s"),
        ({"dt": 2e-5, "followers": [{"model": "idm", "count": 20}]}, "the explorer takes 2e+07; use headway run"),
        ({"output_step": 2e-6}, "the explorer takes 2e+07; use headway run"),
        ({"dt": 1e-7}, "30 s in steps of 1e-07 s are 1.2e+09 steps; the explorer takes 2e+07"),
        ({"output_step": 1e-7}, "4 vehicles for 30 s in steps of 1e-07 s are 1.2e+09 steps"),
        (leader(omega=1e9), "changes too often for the explorer"),
        ({"leader": {"kind": "noise", "mean": 20.0, "sd": 1.0, "sample": 1e-9}}, "changes too often"),
        ({"leader": {"kind": "recorded", "file": "/etc/passwd"}}, "was not started with this recording"),
        ({"followers": [{"model": "idm", "count": 0}]}, "count = 0 is not a whole number"),
        ({"followers": [{"model": "idm", "lag": 0.003}]}, "lag = 0.003 s is too short for steps of 0.01 s"),
        ({"followers": [{"model": "idn"}]}, "did you mean 'idm'"),
    ],
)
def test_limits_have_a_sentence(state, change, sentence):
    state["scenario"] |= change
    with pytest.raises(HeadwayError, match=re.escape(sentence)):
        states.checked_state(state)


def test_the_recording_it_was_started_with_is_allowed(state, tmp_path):
    file = tmp_path / "run.csv"
    rows = [f"{t},{n},{20 + n + t % 3},{30 if n else ''}" for t in range(40) for n in range(2)]
    file.write_text("time_s,vehicle,speed_mps,gap_m\n" + "\n".join(rows) + "\n")
    state["scenario"]["leader"] = {"kind": "recorded", "file": str(file)}
    assert states.checked_state(state, files=[str(file)]).scenario.leader.kind == "recorded"


# -- what it answers ---------------------------------------------------------------------------------


def test_a_state_is_answered_in_order_draft_exact_figures_verdict_map(client, state):
    with connect(client) as link:
        link.send_text(ask(state))
        kinds = []
        while kinds.count("map") < 2:
            header, arrays = receive(link)
            kinds.append(header["kind"])
            if header["kind"] == "curves":
                last = header, arrays
    assert kinds == ["curves", "curves", "figures", "verdict", "map", "map"]
    header, arrays = last
    assert header["draft"] is False
    true = hw.simulate(hw.from_toml(BASE))
    at = true.interp(time=arrays["time"].astype(float))
    np.testing.assert_allclose(arrays["speed"], at.speed, atol=1e-4)
    np.testing.assert_allclose(arrays["error"], at.spacing_error[1:], atol=1e-3)
    assert header["marks"] == [0.63]
    lin = hw.linearize(hw.from_toml(BASE).followers[0], 23.0)
    np.testing.assert_allclose(arrays["gain"], lin.gain(arrays["omega"].astype(float)), rtol=1e-5)


def test_the_map_is_sent_again_only_where_it_changes(client, state):
    with connect(client) as link:
        for number, (name, expected) in enumerate((("T", True), ("T", False), ("a", True)), start=1):
            state["scenario"]["followers"][0]["parameters"][name] = 1.0 + 0.1 * number
            link.send_text(ask(state, number))
            until(link, "verdict", number)
            if expected:
                assert until(link, "map", number)[1]["verdict"].shape == (40, 40)
                assert until(link, "map", number)[1]["verdict"].shape == (110, 110)
        link.send_text(ask(state, 9))
        assert receive(link)[0]["kind"] == "curves"  # and no map of the second before it


def test_a_pin_is_answered_beside_what_is_shown(client, state):
    with connect(client) as link:
        link.send_text(ask(state, 1))
        link.send_text(ask(state, 2, do="pin"))
        seen = set()
        while not {("pinned", 2), ("pinned figures", 2), ("verdict", 1)} <= seen:
            header, _ = receive(link)
            seen.add((header["kind"], header["id"]))


def test_a_draft_has_the_bits_of_simulate_and_is_close_to_the_exact_run(state):
    quick = picture.Quick()
    for gap in (1.2, 1.3, 0.9):
        state["scenario"]["followers"][0]["parameters"]["T"] = gap
        checked = states.checked_state(state)
        _, result = picture.draw(checked, quick, 300, True, never)
        stepped = picture._stepped(checked.scenario, picture.draft_step(checked.scenario), result.time[1])
        tr = hw.simulate(hw.from_toml(stepped.to_toml()))
        assert np.array_equal(result.motion[1, :, :, 0].T, tr.speed.values)
        exact = hw.simulate(checked.scenario).interp(time=result.time)
        np.testing.assert_allclose(result.motion[0, :, :, 0].T, exact.position.values, atol=1e-4)


def test_a_collision_is_shown_and_not_an_error(client, state):
    state["scenario"]["leader"] = {"kind": "brake", "mean": 25.0, "drop": 25.0, "hold": 20.0, "ramp": 2.0}
    state["scenario"]["followers"][0]["delay"] = 2.0
    with connect(client) as link:
        link.send_text(ask(state))
        header, arrays = until(link, "curves", 1)
        hits = [n for n, t in enumerate(header["collisions"]) if t is not None]
        assert hits
        assert np.isnan(arrays["position"][hits[0], -1])
        rows = {row["name"]: row["value"] for row in until(link, "figures", 1)[0]["figures"]}
        assert rows["collisions"] == len(hits)
        assert rows["least gap"] == 0


def test_the_verdict_is_what_headway_stability_says(client, state, cli, tmp_path):
    file = tmp_path / "sc.toml"
    file.write_text(BASE)
    _, out, _ = cli("stability", file)
    with connect(client) as link:
        link.send_text(ask(state))
        sentences = until(link, "verdict", 1)[0]["sentences"]
    assert out.splitlines() == sentences
    lin = hw.linearize(hw.from_toml(BASE).followers[0], 23.0)
    assert sentences[0].endswith(vehicle_verdict(lin, lin.critical_delays()))


@hw.model
def far(s, v, dv, v0l, *, k=0.2, c=0.6, far=0.4, s0=10.0):
    return k * (s - s0) + c * dv + far * (v0l - v)


def test_a_law_that_hears_the_platoon_leader_has_no_verdict_per_vehicle():
    scenario = hw.Scenario(hw.sine(20, 1, 0.5), [hw.Vehicle(far)] * 3, duration=20)
    state = states.checked_state(states.start_state(scenario), [far])
    shown, _ = picture.draw(state, picture.Quick(), 100, True, never)
    badge = shown.header["theory"]
    assert badge["word"] == "no verdict on one vehicle"
    assert "hears the platoon leader" in badge["error"]
    assert "peak" not in badge
    assert "gain" not in shown.arrays
    sentences = answers.verdict_sentences(state, never)
    assert "it hears the platoon leader, so no growth per vehicle is defined" in sentences[0]
    assert not any("string stable" in text or "string unstable" in text for text in sentences)


# -- that it never ends ------------------------------------------------------------------------------


def message(**fields):
    return json.dumps({"do": "show", "id": 1, "points": 200, **fields})


MALFORMED = [
    *("", "{", "[]", "null", "1e999", '"show"', "{}", "[" * 30_000, '{"do": "show"}'),
    *(message(do="quit"), message(id=-1), message(id=True), message(points=1e9), message(points=math.inf), message()),
    message(state={"scenario": {"leader": math.nan}}),
    message(state={"scenario": {"leader": [], "followers": {}}}),
    message(state={"scenario": {"leader": {"kind": 3}, "followers": [4]}}),
]


def test_malformed_messages_get_a_sentence_and_the_next_is_answered(client, state):
    broken = [
        {**state, "group": 7},
        {**state, "map": [["T", 1, 2]]},
        {**state, "map": [["T", 1, 2], ["T", 1, 2]]},
        {**state, "scenario": {**state["scenario"], "duration": "long"}},
        {**state, "scenario": {**state["scenario"], "followers": [{"model": "idm", "count": "2"}]}},
        {**state, "scenario": {**state["scenario"], "followers": [{"model": "idm", "count": 1, "delay": -1}]}},
        {
            **state,
            "scenario": {**state["scenario"], "leader": {"kind": "sine", "mean": 40, "amplitude": 1, "omega": 1}},
        },
    ]
    with connect(client) as link:
        for text in (*MALFORMED, *(ask(s, 5) for s in broken)):
            link.send_text(text)
            header, _ = receive(link)
            assert header["kind"] == "error", text[:80]
            assert re.fullmatch(r"[^\n]+", header["text"])
        link.send_bytes(b"\x00\xff")
        assert "binary" in receive(link)[0]["text"]
        link.send_text(ask(state, 6))
        assert until(link, "curves", 6)[0]["draft"]


def test_a_long_message_gets_a_sentence(client, state):
    with connect(client) as link:
        link.send_text(ask({**state, "more": "x" * 70_000}))
        assert "the explorer takes 65536" in receive(link)[0]["text"]
        link.send_text(ask(state, 2))
        until(link, "curves", 2)
    answer = client.post(f"/{TOKEN}/export/toml", content="x" * 70_000)
    assert answer.status_code == 400
    assert "longer than 65536" in answer.text


def test_a_huge_message_ends_its_connection_and_not_the_server(state):
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect as dial

    with hw.explore(hw.from_toml(BASE), browser=False) as running:
        address, origin = running.url.replace("http", "ws") + "ws", f"http://127.0.0.1:{running.port}"
        with dial(address, origin=origin, max_size=None) as link:
            with contextlib.suppress(ConnectionClosed):
                link.send("x" * (3 << 20))  # the server may close while it is still being sent
            with pytest.raises(ConnectionClosed) as closed:
                link.recv(timeout=10)
        assert closed.value.rcvd.code == 1009
        with dial(address, origin=origin, max_size=None) as link:
            link.send(ask(state))
            assert unpack(link.recv(timeout=10))[0]["kind"] == "curves"


def test_of_rapid_messages_the_last_is_answered_and_most_are_passed_over(client, state):
    with connect(client) as link:
        for number in range(1, 301):
            state["scenario"]["followers"][0]["parameters"]["T"] = 1.0 + 0.001 * number
            link.send_text(ask(state, number))
        drafts, exact = set(), set()
        while 300 not in exact:
            header, _ = receive(link)
            if header["kind"] == "curves":
                (drafts if header["draft"] else exact).add(header["id"])
    assert exact == {300}
    assert len(drafts) < 300


def test_a_law_that_raises_is_told_and_the_next_is_answered(state):
    from starlette.testclient import TestClient

    @hw.model
    def broken(s, v, dv, *, k=0.2):
        """A law that fails where it is asked."""
        if k > 0.5:
            raise LookupError("no such thing")
        return k * (s - 2.0 - v) + dv

    state["scenario"]["followers"] = [{"model": "broken", "parameters": {"k": 0.9}}]
    with TestClient(make_app(TOKEN, state, [broken]), base_url=HERE) as client, connect(client) as link:
        link.send_text(ask(state, 1))
        assert "no such thing" in receive(link)[0]["text"]
        state["scenario"]["followers"] = [{"model": "idm"}]
        link.send_text(ask(state, 2))
        until(link, "curves", 2)


def test_a_stale_run_is_given_up_in_the_middle():
    sc = hw.Scenario(hw.sine(23, 2, 0.63), [hw.Vehicle(hw.models.IDM(), delay=0.1)] * 20, duration=600)
    looks = []

    def stale() -> bool:
        looks.append(time.perf_counter())
        return len(looks) == 3

    with pytest.raises(CancelledError):
        solve(sc, stale)
    assert len(looks) == 3  # of about fifteen


def test_a_newer_state_ends_what_an_older_one_computes(client, state):
    slow = json.loads(json.dumps(state))
    slow["scenario"] |= {"duration": 2000.0, "followers": [{"model": "idm", "count": 90, "delay": 0.3}]}
    with connect(client) as link:
        link.send_text(ask(slow, 1))
        header, _ = receive(link)
        assert (header["id"], header["draft"]) == (1, True)
        time.sleep(0.2)  # by now the exact run of the first goes on
        link.send_text(ask(state, 2))
        header, _ = receive(link)
        assert (header["id"], header["draft"]) == (2, True)
        header, _ = until(link, "curves", 2)
        assert not header["draft"]


# -- state, address, file, lines ---------------------------------------------------------------------

SCENARIOS = {
    "base": BASE,
    "mix": """duration = 20
seed = 3
gap_offsets = { 2 = -1.5 }
[leader]
kind = "noise"
mean = 20
sd = 0.7
[[followers]]
model = "idm"
count = 2
lag = 0.2
delay = { s = 0.1, vl = 0.3 }
limits = [-6.0, 2.0]
[[followers]]
model = "cacc"
delay = { vl = 0.15, al = 0.15 }
[[followers]]
model = "idm"
count = 2
lag = 0.2
delay = { s = 0.1, vl = 0.3 }
limits = [-6.0, 2.0]
""",
    "gmm": """duration = 20
gaps = 25.5
dt = 0.02
[leader]
kind = "multisine"
mean = 20
amplitudes = [0.5, 0.2]
omegas = [0.31, 1.7]
[[followers]]
model = "gmm"
count = 3
""",
}


@pytest.fixture(params=[*SCENARIOS, "paper:cacc-window", "example:wltc-stops-ovm"])
def scenario(request):
    if request.param in SCENARIOS:
        return hw.from_toml(SCENARIOS[request.param])
    return hw.library.library_scenario(request.param)


def test_state_address_and_file_are_the_same_scenario(scenario):
    state = states.start_state(scenario)
    address = f"http://127.0.0.1:1/t/#{states.encode(state)}"
    assert re.fullmatch(r"[\w-]+", states.encode(state))
    again = states.decode(address)
    assert again == json.loads(json.dumps(state))
    checked = states.checked_state(again)
    assert checked.scenario == scenario
    assert hw.from_toml(exports.export(checked, "toml", {})) == scenario


def test_the_lines_reproduce_the_scenario_and_its_numbers(scenario):
    space: dict = {}
    exec(python_lines(scenario), space)
    assert space["sc"] == scenario
    assert space["tr"].equals(hw.simulate(scenario))


def test_the_lines_find_a_law_of_ones_own(tmp_path):
    file = tmp_path / "mine.py"
    code = ["import headway as hw", "@hw.model", "def mine(s, v, dv, *, k=0.2):", "    return k * (s - 2 - v) + dv", ""]
    file.write_text("\n".join(code))
    (law,) = hw.load_laws(str(file))
    sc = hw.Scenario(hw.sine(20, 1, 0.5), [hw.Vehicle(law(k=0.3))] * 2, duration=5)
    lines = python_lines(sc, {"mine": f"{file}:mine"})
    space: dict = {}
    exec(lines, space)
    assert space["sc"].to_toml() == sc.to_toml()
    assert np.array_equal(space["tr"].gap, hw.simulate(sc).gap, equal_nan=True)


@pytest.mark.parametrize("text", ["", "#", "#!!", "#bnVsbA", "#e30", "http://127.0.0.1/x/"])
def test_an_address_without_a_state_is_refused(text):
    with pytest.raises(HeadwayError, match="holds no state of the explorer"):
        states.decode(text)


def test_exports_are_files_of_the_state(client, state, tmp_path):
    give = {form: client.post(f"/{TOKEN}/export/{form}", content=json.dumps(state)) for form in exports.FORMS}
    assert {form: answer.status_code for form, answer in give.items()} == dict.fromkeys(exports.FORMS, 200)
    sc = hw.from_toml(BASE)
    assert hw.from_toml(give["toml"].text) == sc
    assert give["py"].text == python_lines(sc)
    hw.save(hw.simulate(sc), tmp_path / "run.csv")
    assert give["csv"].text == (tmp_path / "run.csv").read_text()
    state["scenario"]["duration"] = -1
    refused = client.post(f"/{TOKEN}/export/toml", content=json.dumps(state))
    assert (refused.status_code, refused.text.strip()) == (400, "scenario.duration = -1 is not greater than 0")
    assert client.post(f"/{TOKEN}/export/exe", content="{}").status_code == 404


# -- the command line --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--port", "70000"], "--port 70000: allowed are 0 to 65535"),
        (["nothing.toml"], "nothing.toml: cannot be read"),
        (["paper:idm-9"], "did you mean 'paper:idm-"),
        (["http://127.0.0.1/#x"], "the address holds no state"),
        (["--set", "followers.0.count=500"], "500 vehicles are too many for the explorer"),
        (["--model", "none.py:soft"], "there is no such file"),
    ],
)
def test_what_is_typed_wrongly_gets_one_sentence(cli, arguments, sentence):
    code, out, err = cli("explore", "--no-browser", *arguments)
    assert code == 2
    assert not out
    assert sentence in err
    assert err.count("\n") == 1

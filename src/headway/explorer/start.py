"""Starting the explorer: from the command line, a script or a notebook."""

from __future__ import annotations

import contextlib
import secrets
import socket
import threading
import time
import webbrowser
from collections.abc import Iterable, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Any

from headway.errors import HeadwayError

if TYPE_CHECKING:
    from headway.models import Law
    from headway.scenario.scenario import Scenario

__all__ = ["Explorer", "explore"]

#: a message beyond this many bytes ends the connection; the page is told of smaller ones that are too long
_MOST_BYTES = 1 << 20


class Explorer:
    """A running explorer: `url` is its address, `close()` or the end of a `with` block ends it, `wait()` stays."""

    def __init__(self, app: Any, port: int) -> None:
        import uvicorn

        try:
            listening = socket.create_server(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise HeadwayError(f"port = {port}: the explorer cannot listen ({reason}); 0 takes a free one") from None
        self.port = int(listening.getsockname()[1])
        self.url = f"http://127.0.0.1:{self.port}/{app.token}/"
        config = uvicorn.Config(
            app, log_level="warning", access_log=False, lifespan="off", ws_max_size=_MOST_BYTES,
            ws_per_message_deflate=False, server_header=False, timeout_graceful_shutdown=1,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(target=self._server.run, args=([listening],), daemon=True, name="explorer")
        self._thread.start()
        while not self._server.started and self._thread.is_alive():
            time.sleep(0.002)

    def wait(self) -> None:
        """Stay until the explorer is closed or the program is interrupted."""
        try:
            while self._thread.is_alive():
                self._thread.join(0.5)
        finally:
            self.close()

    def close(self) -> None:
        """End the explorer."""
        self._server.should_exit = True
        self._thread.join(5.0)

    def __enter__(self) -> Explorer:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<explorer at {self.url}>"

    def _repr_html_(self) -> str:
        return f'<a href="{self.url}" target="_blank" rel="noopener">headway explorer at {self.url}</a>'


def explore(
    scenario: Scenario | Mapping[str, Any],
    *,
    models: Iterable[Law] = (),
    references: Mapping[str, str] | None = None,
    port: int = 0,
    browser: bool = True,
) -> Explorer:
    """Open a page in the browser whose sliders move this scenario.

    Args:
        scenario: A `Scenario`, or a state of the explorer's page (`headway.explorer.state`).
        models: Laws of one's own that the page may choose beside those of the scenario and the built-in ones.
        references: By name, where they are (my.py:soft), for the Python lines that the page gives.
        port: Of 127.0.0.1; 0 takes a free one.
        browser: Whether to open the page in the browser.

    Returns:
        An `Explorer` that runs in a thread until it is closed or the program ends.

    Raises:
        HeadwayError: If the scenario is beyond what the explorer takes, if the port is taken, or without the packages
            of the `explorer` extra.
    """
    try:
        from headway.explorer.server import make_app, plotly_script
    except ModuleNotFoundError as error:
        raise HeadwayError(
            f"the explorer needs {error.name}; install it with pip install 'headway[explorer]'"
        ) from None
    from headway.explorer import state as states
    from headway.models.registry import BUILT_IN

    plotly_script()
    laws = {law.name: law for law in models}
    if isinstance(scenario, Mapping):
        state = dict(scenario)
    else:
        laws |= {f.model.name: f.model.law for f in scenario.followers}
        state = states.start_state(scenario)
    own = [law for law in laws.values() if BUILT_IN.get(law.name) is not law]
    leader = state["scenario"].get("leader")
    files = [leader["file"]] if isinstance(leader, Mapping) and "file" in leader else []
    states.checked_state(state, own, files)
    explorer = Explorer(make_app(secrets.token_urlsafe(18), state, own, references), port)
    threading.Thread(target=_warm, args=(state, own, files), daemon=True, name="warming").start()
    if browser:
        webbrowser.open(explorer.url)
    return explorer


def _warm(state: Mapping[str, Any], laws: list[Law], files: list[str]) -> None:
    """Load and compile what the first picture needs while the browser is loading the page."""
    from headway.explorer.picture import Quick, draw
    from headway.explorer.state import checked_state

    with contextlib.suppress(HeadwayError, ArithmeticError, ValueError):  # the page will say what is wrong
        draw(checked_state(state, laws, files), Quick(), 600, True, lambda: False)

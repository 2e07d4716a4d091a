"""The catalogue: complete entries, a verified download, and nothing left behind when it fails."""

from __future__ import annotations

import functools
import hashlib
import http.server
import threading
from pathlib import Path

import pytest
from conftest import shared_file

import headway.data as data
from headway.data import catalogue, fetch, read
from headway.data.cycles import CYCLES
from headway.errors import HeadwayError

ASTAZERO = "openacc-astazero-example"


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@pytest.fixture
def serve():
    """Serve a folder on a free local port; the answer is its address."""
    servers = []

    def start(folder: Path) -> str:
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=str(folder)))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        servers.append(server)
        return f"http://127.0.0.1:{server.server_address[1]}"

    yield start
    for server in servers:
        server.shutdown()
        server.server_close()


@pytest.fixture(autouse=True)
def no_environment(monkeypatch):
    monkeypatch.delenv("HEADWAY_DATA_URL", raising=False)
    monkeypatch.delenv("HEADWAY_DATA_DIR", raising=False)


@pytest.fixture
def raw() -> Path:
    return shared_file("raw")


def test_every_entry_is_complete():
    entries = catalogue()
    assert {"openacc-zalazone-short-part4", "openacc-zalazone-long-part19", ASTAZERO, *CYCLES} == set(entries)
    for name, entry in entries.items():
        assert name == entry.name
        assert entry.bytes > 0
        assert len(entry.sha256) == 64
        assert entry.title
        assert entry.provenance
        assert entry.licence
        assert entry.attribution
        assert entry.format in data.FORMATS
        assert entry.address.startswith("https://") == (entry.kind == "download")
    assert entries[ASTAZERO].address.endswith("/AV%20model%20funtion/MPL%20Modeling%20methodology/data_example.csv")


@pytest.mark.parametrize("name", [name for name, entry in catalogue().items() if entry.kind == "shipped"])
def test_shipped_files_are_what_the_catalogue_says(name, tmp_path):
    entry = catalogue()[name]
    copy = fetch(name, directory=tmp_path / "new")
    assert [p.name for p in copy.parent.iterdir()] == [entry.file]
    content = copy.read_bytes()
    assert content == fetch(name).read_bytes()
    assert len(content) == entry.bytes
    assert hashlib.sha256(content).hexdigest() == entry.sha256
    recording = read(copy)
    assert (recording.vehicles, recording.duration) == (entry.vehicles, entry.seconds)


@pytest.mark.parametrize("name", [ASTAZERO, "openacc-zalazone-short-part4"])
def test_download_from_a_mirror(name, raw, serve, tmp_path):
    entry = catalogue()[name]
    path = fetch(name, base_url=serve(raw), directory=tmp_path)
    assert path == tmp_path / entry.file
    assert path.stat().st_size == entry.bytes
    recording = read(path)
    assert recording.vehicles == entry.vehicles
    assert recording.duration == pytest.approx(entry.seconds)
    # A second time needs no server: the file is there and its hash is right.
    assert fetch(name, base_url="http://127.0.0.1:9", directory=tmp_path) == path


def test_mirror_and_folder_by_environment(raw, serve, tmp_path, monkeypatch):
    monkeypatch.setenv("HEADWAY_DATA_URL", serve(raw) + "/")
    monkeypatch.setenv("HEADWAY_DATA_DIR", str(tmp_path / "here"))
    assert fetch(ASTAZERO).parent == tmp_path / "here"


def test_a_damaged_copy_is_downloaded_again(raw, serve, tmp_path):
    kept = tmp_path / catalogue()[ASTAZERO].file
    kept.write_text("damaged")
    fetch(ASTAZERO, base_url=serve(raw), directory=tmp_path)
    assert kept.stat().st_size == catalogue()[ASTAZERO].bytes


def refused(directory: Path, match: str, **options) -> None:
    with pytest.raises(HeadwayError, match=match) as caught:
        fetch(ASTAZERO, directory=directory, **options)
    assert "\n" not in str(caught.value)
    assert not directory.is_dir() or not list(directory.iterdir())


def test_wrong_content_is_refused_and_not_kept(serve, tmp_path):
    site = tmp_path / "site"
    site.mkdir()
    (site / catalogue()[ASTAZERO].file).write_text("something else")
    refused(tmp_path / "kept", "does not have the SHA-256 d79aeca9", base_url=serve(site))


def test_not_found(serve, tmp_path):
    (tmp_path / "site").mkdir()
    refused(tmp_path / "kept", "the server answered 404", base_url=serve(tmp_path / "site"))


def test_no_connection(tmp_path):
    refused(tmp_path / "kept", r"cannot be downloaded \(no connection\)", base_url="http://127.0.0.1:9")


@pytest.mark.parametrize("address", ["nonsense", "ftp://127.0.0.1", "http://"])
def test_no_address(tmp_path, address):
    refused(tmp_path / "kept", "cannot be downloaded|not an address", base_url=address)


@pytest.mark.parametrize("name", [ASTAZERO, "udds"])
def test_directory_that_cannot_be_made(name, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(HeadwayError, match="cannot be written"):
        fetch(name, base_url="http://127.0.0.1:9", directory=tmp_path / "file" / "below")


def test_unknown_name():
    with pytest.raises(HeadwayError, match="did you mean 'openacc-astazero-example'"):
        fetch("openacc-astazero")

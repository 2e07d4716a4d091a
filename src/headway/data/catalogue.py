"""A catalogue of real trajectories: where they come from, under what licence, and a verified download.

The recordings belong to others and are not part of the package. `fetch` downloads one from its public address and
checks its SHA-256; the drive cycles are shipped.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote, urlsplit

from headway.checked import typed
from headway.data.cycles import cycle_file
from headway.errors import HeadwayError, unknown_name

__all__ = ["CatalogueEntry", "catalogue", "fetch"]

TIMEOUT = 30.0  # s without an answer


@dataclass(frozen=True)
class CatalogueEntry:
    """One file of the catalogue.

    Attributes:
        name: what `fetch` calls it.
        title: what it holds.
        kind: `download` or `shipped`.
        file: its name on disk.
        format: its format for `read`.
        provenance: who measured or published it.
        licence: under what licence.
        attribution: the sentence that names the authors.
        address: its public address, "" if shipped.
        bytes: size of the file as published.
        sha256: SHA-256 of the file as published.
        vehicles: number of vehicles, None where it is not stated.
        seconds: length of the record [s], None where it is not stated.
    """

    name: str
    title: str
    kind: str
    file: str
    format: str
    provenance: str
    licence: str
    attribution: str
    address: str
    bytes: int
    sha256: str
    vehicles: int | None
    seconds: float | None


def _github(repository: str, commit: str, path: str) -> str:
    """The address of a file's raw content at one commit."""
    return f"https://raw.githubusercontent.com/{repository}/{commit}/{quote(path)}"


_OPENACC = (
    "European Commission, Joint Research Centre, Open ACC Database, doi:10.2905/JRC.KMH3D00; Makridis et al., Transp. "
    "Res. C 125 (2021) 103047, doi:10.1016/j.trc.2021.103047"
)
_OPENACC_LICENCE = "CC BY 4.0, according to two independent redistributors"
_OPENACC_ATTRIBUTION = "Contains data from Open ACC Database, European Commission, Joint Research Centre, CC BY 4.0"
_ZALAZONE = ("thibault-charlottin/ACC-platoon-fuel-consumption", "8781ec31a976113210a9809b98345c76594c3896")
_FASTSIM = "the tables of fastsim 2.1.5 (Alliance for Sustainable Energy, LLC)"
_FASTSIM_ATTRIBUTION = "Contains drive-cycle tables from FASTSim, Copyright 2020 Alliance for Sustainable Energy, LLC"


_Rest = tuple[str, int, str, int | None, float | None]  # file, bytes, sha256, vehicles, seconds


def _openacc(name: str, title: str, format: str, address: str, rest: _Rest) -> CatalogueEntry:
    file, size, sha256, vehicles, seconds = rest
    return CatalogueEntry(
        name, title, "download", file, format, _OPENACC, _OPENACC_LICENCE, _OPENACC_ATTRIBUTION, address, size, sha256,
        vehicles, seconds,
    )  # fmt: skip


def _cycle(name: str, title: str, origin: str, size: int, sha256: str, seconds: float) -> CatalogueEntry:
    return CatalogueEntry(
        name, title, "shipped", f"{name}.csv", "tidy", f"{origin}, from {_FASTSIM}", "Apache-2.0", _FASTSIM_ATTRIBUTION,
        "", size, sha256, 1, seconds,
    )  # fmt: skip


_ENTRIES = (
    _openacc(
        "openacc-astazero-example",
        "Five cars on the AstaZero test track: production ACC, 33 min at 10 Hz",
        "openacc-astazero",
        _github(
            "usdot-fhwa-stol/To-21-426-multivariate-piecewise-linear-ACC-car-following-model",
            "11b7f2319fc55c8c680bde54dedc298f57eb0b1f",
            "AV model funtion/MPL Modeling methodology/data_example.csv",
        ),
        (
            "astazero_data_example.csv",
            2_204_823,
            "d79aeca943321cc4ef2ddd93b2670e3dd1a68551aa1a9334ec0208669e83e433",
            5,
            1983.9,
        ),
    ),
    _openacc(
        "openacc-zalazone-short-part4",
        "Eleven cars on the ZalaZone dynamic platform: production ACC, shortest setting, 225 s at 10 Hz",
        "openacc-zalazone",
        _github(*_ZALAZONE, "data/OpenACC_data/short_setting/dynamic_part4.csv"),
        (
            "zalazone_short_dynamic_part4.csv",
            2_986_869,
            "d381fa3c2152318f9aa20c3646c12e6d586a64ceeb22a320e7b5db7c86aa2ab0",
            11,
            224.8,
        ),
    ),
    _openacc(
        "openacc-zalazone-long-part19",
        "Cars on the ZalaZone dynamic platform: production ACC, longest setting, 10 Hz",
        "openacc-zalazone",
        _github(*_ZALAZONE, "data/OpenACC_data/long_setting/dynamic_part19.csv"),
        (
            "zalazone_long_dynamic_part19.csv",
            1_916_492,
            "bf3df7ab4c45a781a2a4cb931de50eee360b96af59b1591f0b88b82f11076357",
            None,
            None,
        ),
    ),
    _cycle(
        "wltc3b",
        "WLTC class 3b",
        "UN GTR 15 figures",
        16_802,
        "d6f960e2fded87cfc272b756c462d78f531b82bb9e4dd6c87530429a64dcb2f2",
        1800.0,
    ),
    _cycle(
        "wltc3a",
        "WLTC class 3a",
        "UN GTR 15 figures",
        16_802,
        "2f4ece3ff648126465f0b72fcd017721d8339dd38f4dcba82124aa54a7976a80",
        1800.0,
    ),
    _cycle(
        "udds",
        "UDDS",
        "US EPA figures",
        12_198,
        "a10855641577936fbb972404ab326a83f1e10bf0dfabe513577bfd5ec2290308",
        1369.0,
    ),
    _cycle(
        "us06",
        "US06",
        "US EPA figures",
        5_233,
        "3976587932c8995db890feb95e7734493ab9e8421dbfc1b45c21d8bb07b2ef3e",
        600.0,
    ),
    _cycle(
        "hwfet",
        "HWFET",
        "US EPA figures",
        6_786,
        "01a52b894c3b800607927db8b7b34fadeefd326f5e0f7cbe45741a68d0fac993",
        765.0,
    ),
)


def catalogue() -> dict[str, CatalogueEntry]:
    """All entries of the catalogue by name."""
    return {entry.name: entry for entry in _ENTRIES}


@typed
def fetch(name: str, *, base_url: str | None = None, directory: str | Path | None = None) -> Path:
    """The path of a file of the catalogue, downloaded once and verified by SHA-256 each time.

    Args:
        name: a key of `catalogue()`.
        base_url: a mirror that holds the files under their names (`CatalogueEntry.file`); the environment's
            HEADWAY_DATA_URL, then the public address, if None.
        directory: where to put files; HEADWAY_DATA_DIR, then the user's cache, if None.

    Returns:
        The path; of a shipped file its place in the package, or its copy in `directory`.

    Raises:
        HeadwayError: for an unknown name, no connection, an answer other than the file, a wrong SHA-256, or a directory
            that cannot be written; none of them leaves anything behind.
    """
    entries = catalogue()
    if name not in entries:
        raise unknown_name("catalogue", name, entries)
    entry = entries[name]
    if entry.kind == "shipped":
        return _shipped(entry, directory)
    mirror = base_url or os.environ.get("HEADWAY_DATA_URL")
    address = f"{mirror.rstrip('/')}/{quote(entry.file)}" if mirror else entry.address
    return _download(entry, address, Path(directory or os.environ.get("HEADWAY_DATA_DIR") or _cache()))


def _cache() -> Path:
    import pooch

    return Path(pooch.os_cache("headway"))


def _shipped(entry: CatalogueEntry, directory: str | Path | None) -> Path:
    source = cycle_file(entry.name)
    if directory is None:
        return source
    target = Path(directory) / entry.file
    partial = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_bytes(source.read_bytes())
            os.replace(partial, target)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise HeadwayError(f"{entry.name}: {target} cannot be written ({error.strerror})") from None
    return target


def _download(entry: CatalogueEntry, address: str, directory: Path) -> Path:
    import pooch
    import requests

    if urlsplit(address).scheme not in ("http", "https"):
        raise HeadwayError(f"{entry.name}: {address} is not an address to download from; it begins with http(s)://")
    # pooch downloads to a temporary name in the same folder, checks the hash and only then renames.
    logger = pooch.get_logger()
    level = logger.level
    logger.setLevel("ERROR")
    try:
        path = pooch.retrieve(
            address,
            known_hash=f"sha256:{entry.sha256}",
            fname=entry.file,
            path=directory,
            downloader=pooch.HTTPDownloader(timeout=TIMEOUT),
        )
    except requests.exceptions.RequestException as error:
        raise HeadwayError(f"{entry.name}: {address} cannot be downloaded ({_reason(error)})") from None
    except OSError as error:
        raise HeadwayError(f"{entry.name}: {directory} cannot be written ({error.strerror or error})") from None
    except ValueError:  # the address is sound, so it is the hash
        raise HeadwayError(
            f"{entry.name}: the file at {address} does not have the SHA-256 {entry.sha256} of the catalogue, so it is "
            "not kept"
        ) from None
    finally:
        logger.setLevel(level)
    return Path(path)


def _reason(error: Exception) -> str:
    """The server's answer, or the kind of failure: the text of connection errors runs over many lines."""
    response = getattr(error, "response", None)
    if response is not None:
        return f"the server answered {response.status_code} {response.reason}"
    name = type(error).__name__
    return "no answer in time" if "Timeout" in name else "no connection" if "ConnectionError" in name else name

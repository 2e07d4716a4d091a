"""Build the documentation site: `python tools/build_docs.py`, from the root of the repository.

Gathers docs/ and the pages made of the program in out/site, builds out/docs, and then looks at every
page as it was built: each link leads to a file and a place that exist, and nothing that a page loads
comes from another host. What is wrong is listed, with exit code 1.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

from reference import PAGES

__all__ = ["broken", "gather", "main"]

ROOT = Path(__file__).resolve().parents[1]
GATHERED, BUILT = ROOT / "out" / "site", ROOT / "out" / "docs"

#: tags that load what they name, rather than lead to it
_LOADED = {"script": "src", "img": "src", "link": "href", "source": "src", "iframe": "src", "video": "src"}
#: relations of <link> that only lead somewhere
_LEADING = {"canonical", "next", "prev", "alternate"}


def gather(folder: Path) -> None:
    """Put every page of the site into `folder`."""
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / "docs", folder)
    for page, write in PAGES.items():
        (folder / page).parent.mkdir(parents=True, exist_ok=True)
        (folder / page).write_text(write(), encoding="utf-8")


class _Page(HTMLParser):
    """What a page names: its anchors, what it links to and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.loads: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {name: value or "" for name, value in attrs}
        self.anchors |= {found[name] for name in ("id", "name") if name in found}
        if tag == "a" and "href" in found:
            self.links.add(found["href"])
        if tag in _LOADED and _LOADED[tag] in found and found.get("rel") not in _LEADING:
            self.loads.add(found[_LOADED[tag]])


def broken(site: Path) -> list[str]:
    """A sentence for each link of a built site that leads nowhere and each thing that it loads from elsewhere."""
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    found = []
    for path, page in pages.items():
        here = path.relative_to(site)
        if here.name == "404.html":
            continue  # it is served at any depth and names its files from the root
        for target in sorted(page.loads | page.links):
            url = urlsplit(target)
            if url.scheme == "data":
                continue
            if url.scheme or url.netloc:
                if target in page.loads:
                    found.append(f"{here}: loads {target} from another host")
                continue
            goal = (path.parent / unquote(url.path)).resolve() if url.path else path
            if goal.is_dir():
                goal = goal / "index.html"
            if not goal.is_file():
                found.append(f"{here}: {target} does not exist")
            elif url.fragment and goal in pages and unquote(url.fragment) not in pages[goal].anchors:
                found.append(f"{here}: {target} has no such place")
    for path in sorted(site.rglob("*.css")):
        for target in re.findall(r"(?:url\(|@import)\s*['\"]?((?:https?:)?//[^'\")\s]+)", path.read_text("utf-8")):
            found.append(f"{path.relative_to(site)}: loads {target} from another host")
    return found


def main() -> int:
    """Build and check; the exit code."""
    gather(GATHERED)
    shutil.rmtree(BUILT, ignore_errors=True)
    built = subprocess.run([sys.executable, "-m", "zensical", "build", "--clean", "--strict"], cwd=ROOT)
    if built.returncode:
        return 1
    for sentence in (found := broken(BUILT)):
        print(sentence, file=sys.stderr)
    print(f"{BUILT.relative_to(ROOT)}/index.html: {len(list(BUILT.rglob('*.html')))} pages, {len(found)} broken links")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

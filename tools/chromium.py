"""The browser that the tests of the explorer's page need: `python tools/chromium.py` installs it where it is missing.

On Debian and its kin, as root or with a sudo that asks nothing. Elsewhere one sentence says what to do: exit code 1.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

__all__ = ["find", "install", "main"]

#: what it is called on the PATH
NAMES = ("chromium", "chromium-browser", "google-chrome")


def find() -> str | None:
    """The program, of the machine or else playwright's own; None where there is neither."""
    for path in filter(None, map(shutil.which, NAMES)):
        return path
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        own = playwright.chromium.executable_path
    return own if Path(own).exists() else None


def install() -> str:
    """Install Debian's package; the reason why it cannot be done, "" when it was."""
    if shutil.which("apt-get") is None:
        return "this machine has no apt-get"
    before: list[str] = []
    if os.geteuid() != 0:
        if shutil.which("sudo") is None or subprocess.run(["sudo", "-n", "true"], capture_output=True).returncode:
            return "apt-get needs root, or sudo without a password"
        before = ["sudo", "-n"]
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for command in (["update", "-qq"], ["install", "-y", "-qq", "--no-install-recommends", "chromium"]):
        done = subprocess.run([*before, "apt-get", *command], env=quiet, capture_output=True, text=True)
        if done.returncode:
            last = (done.stderr.strip() or done.stdout.strip() or "without a word").splitlines()[-1]
            return f"apt-get {command[0]} failed: {last}"
    return ""


def main() -> int:
    """Find, or install and find; the exit code."""
    path, reason = find(), ""
    if path is None:
        reason = install()
        path = find()
    if path is None:
        why = reason or "it is not found although it was installed"
        print(f"no Chromium ({why}); install one of {', '.join(NAMES)} to test the page", file=sys.stderr)
        return 1
    print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""`python -m headway`, and the command of that name."""

from __future__ import annotations

import sys

from headway.errors import HeadwayError

__all__ = ["main"]


def main() -> None:
    """Run the command line; an environment in which it cannot even be loaded gets its sentence here."""
    try:
        from headway.cli import main as run
    except HeadwayError as error:
        print(f"headway: {error}", file=sys.stderr)
        sys.exit(2)
    run()


if __name__ == "__main__":
    main()

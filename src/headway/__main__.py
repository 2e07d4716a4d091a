"""`python -m headway`, and the command of that name."""

from __future__ import annotations

import sys

__all__ = ["main"]


def main() -> None:
    """Load the command line and run it.

    Loading takes a third of a second: an environment in which that fails, or a hand that ends it, gets its sentence
    here. Nothing is imported before, so that there is no moment without one.
    """
    try:
        from headway.errors import HeadwayError

        try:
            from headway.cli import execute
        except HeadwayError as error:
            _leave(str(error), 2)
        execute()
    except KeyboardInterrupt:
        _leave("interrupted", 130)


def _leave(sentence: str, code: int) -> None:
    print(f"headway: {sentence}", file=sys.stderr)
    sys.exit(code)


if __name__ == "__main__":
    main()

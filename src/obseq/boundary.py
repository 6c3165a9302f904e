"""What explains a result, or shows it, may fail: the result stays, and the failure is told."""

from __future__ import annotations

import logging
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TypeVar

Answer = TypeVar("Answer")
Other = TypeVar("Other")
Text = TypeVar("Text")
_LOG = logging.getLogger(__name__)
_SEARCHES_END: ContextVar[bool] = ContextVar("searches end", default=False)


@contextmanager
def interruptions_end_searches() -> Iterator[None]:
    """An interruption of a search for errors ends the search alone: the result is there."""
    token = _SEARCHES_END.set(True)
    try:
        yield
    finally:
        _SEARCHES_END.reset(token)


class Boundary:
    """Keeps a result from what comes after it.

    Attributes:
        failures: What failed, in sentences.

    Example:
        >>> boundary = Boundary()
        >>> boundary.attempt("the page", lambda: 1 / 0, "")
        ''
        >>> boundary.failures[0].partition(" (")[0]
        'the page failed: ZeroDivisionError: division by zero'
    """

    def __init__(self) -> None:
        self.failures: list[str] = []

    def attempt(
        self, what: str, work: Callable[[], Answer], otherwise: Other, ends: bool = False
    ) -> Answer | Other:
        """The answer of some work; where it fails, another one, and the failure is kept.

        Args:
            what: What the work is, to begin a sentence.
            work: What may fail, by whatever error.
            otherwise: The answer then.
            ends: Whether it is a search (`interruptions_end_searches`); else interruptions go through.
        """
        try:
            return work()
        except KeyboardInterrupt:
            if not (ends and _SEARCHES_END.get()):
                raise
            self.failures.append(f"{what} was interrupted: the result is as computed, without it")
            return otherwise
        except Exception as error:
            self.tell(what, error)
            return otherwise

    def tell(self, what: str, error: Exception) -> None:
        """Keeps a failure."""
        _LOG.info("%s failed", what, exc_info=error)
        self.failures.append(_sentence(what, error))

    def texts(self, writers: Mapping[Path, Callable[[], Text]]) -> dict[Path, Text]:
        """The texts of files by their writers; without those that fail."""
        made = {path: self.attempt(str(path), write, None) for path, write in writers.items()}
        return {path: text for path, text in made.items() if text is not None}


def _sentence(what: str, error: Exception) -> str:
    """What failed, why and where; the result is there all the same."""
    last = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{Path(last.filename).name}:{last.lineno}"
    said = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    return (
        f"{what} failed: {said} ({place}). The result is as computed, without it. "
        "Please report this as a defect of obseq"
    )

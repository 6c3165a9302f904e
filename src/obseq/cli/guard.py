"""What ends a command: every error becomes one message and an exit code."""

import _thread
import io
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from obseq.errors import ObseqError
from obseq.printable import printable

CANNOT_RUN = 2
INTERRUPTED = 130
SOON = 0.01
"""Seconds until an interruption that was lost comes again."""


def guarded(program: str, work: Callable[[], int]) -> int:
    """The exit code of some work, or that of its failure, said on standard error in the name of a program."""
    _open_closed_streams()
    _print_any_character()
    try:
        with _ended_as_by_the_keyboard(), _no_interruption_lost():
            code = work()
            sys.stdout.flush()
    except ObseqError as error:
        for note in getattr(error, "__notes__", ()):
            _say(f"note: {note}")
        return _fail(program, str(error))
    except BrokenPipeError:
        _forget_standard_output()
        return 0
    except OSError as error:
        where = f"{error.filename}:" if error.filename else "the output cannot be written:"
        return _fail(program, f"{where} {error.strerror}" if error.strerror else str(error))
    except MemoryError:
        return _fail(program, "There is not enough memory for this computation.")
    except KeyboardInterrupt:
        _say(f"\n{program}: interrupted; no file is half-written.")
        return INTERRUPTED
    except Exception:
        _say(traceback.format_exc())
        return _fail(
            program, "This is a defect of obseq: please report it with the lines above and `obseq versions`."
        )
    return code


@contextmanager
def _ended_as_by_the_keyboard() -> Iterator[None]:
    """SIGTERM does what Ctrl-C does: the work ends by KeyboardInterrupt, and cleans up."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before or signal.SIG_DFL)


@contextmanager
def _no_interruption_lost() -> Iterator[None]:
    """An interruption that hits a callback, from which Python lets no exception out, comes again.

    Imports have such callbacks. The signal is the one that surely interrupts: SIGINT may be ignored.
    """
    usual, again = sys.unraisablehook, list[threading.Timer]()

    def interrupt_soon(unraisable: "sys.UnraisableHookArgs") -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            usual(unraisable)
            return
        again.append(threading.Timer(SOON, _thread.interrupt_main, [signal.SIGTERM]))
        again[-1].start()

    sys.unraisablehook = interrupt_soon
    try:
        yield
    finally:
        sys.unraisablehook = usual
        for timer in again:
            timer.cancel()


def _fail(program: str, message: str) -> int:
    _say(f"{program}: {message}")
    return CANNOT_RUN


def _say(message: str) -> None:
    sys.stderr.write(printable(f"{message}\n"))


def _open_closed_streams() -> None:
    """A service may start us without standard output: what is printed there is lost, and nothing else."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, os.fdopen(os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"))


def _print_any_character() -> None:
    """Let names that the terminal cannot show be printed as escapes instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _forget_standard_output() -> None:
    """The reader of our output has gone (`obseq formulas | head`): leave nothing to flush at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())

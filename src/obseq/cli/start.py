"""Where the `obseq` command starts: Ctrl-C ends it with one line, while it loads as well.

This module loads nothing that takes time, so that its handler stands before anything slow begins.
"""

import gc
import os
import signal
import sys
import time
from typing import NoReturn

BEGUN = time.perf_counter()
INTERRUPTED = 130

NEW_OBJECTS = 200_000
"""So many new objects make Python look for garbage: a run makes next to none, and what modules make stays."""

os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "10")  # threads that wait for work sleep


def main() -> int:
    """Load the command, run it and return its exit code."""
    gc.set_threshold(NEW_OBJECTS, *gc.get_threshold()[1:])
    is_ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if is_ours:
        signal.signal(signal.SIGINT, _leave)
    try:
        from obseq.stopwatch import Stopwatch

        Stopwatch.begun = BEGUN
        from obseq.cli.main import main as run

        if is_ours:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        code = run()
        gc.freeze()  # what ends with the process need not be looked through
        return code
    except KeyboardInterrupt:
        _leave()


def _leave(*_: object) -> NoReturn:
    """End the process at once: while modules are loaded there is nothing to clean up."""
    os.write(2, b"\nobseq: interrupted; no file is half-written.\n")
    os._exit(INTERRUPTED)


if __name__ == "__main__":
    sys.exit(main())

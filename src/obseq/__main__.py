"""`python -m obseq`: the `obseq` command."""

import sys

from obseq.cli.start import main

if __name__ == "__main__":
    sys.exit(main())

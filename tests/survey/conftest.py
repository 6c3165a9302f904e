"""Makes importable, as pytest's importlib mode does not, the files that several tests share."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

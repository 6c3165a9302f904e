"""Makes importable, as pytest's importlib mode does not: `networks.py`, systems that several tests share, and
the files of `tools` (`bal.py`).
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[2] / "tools" / "benchmarks"))

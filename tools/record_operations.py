"""Records the operations of every generated kernel as the bounds that the tests hold them to.

Run it after adding a formula. After a change of the generator it shows what would get worse, and writes that
only when told to.

Example:
    python tools/record_operations.py --accept-more
"""

import argparse
import json
from pathlib import Path

from obseq.kernels import formula_names, load

BOUNDS = Path(__file__).parents[1] / "tests" / "codegen" / "operation_bounds.json"


def main() -> int:
    """Compares, shows, writes; returns 1 when a count went up and was not accepted."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--accept-more", action="store_true", help="record higher counts too")
    accept = parser.parse_args().accept_more
    old = json.loads(BOUNDS.read_text("utf-8"))["operations"] if BOUNDS.exists() else {}
    new = {name: list(load(name).module.OPERATIONS) for name in formula_names()}
    more = [
        name for name in new if name in old and any(a > b for a, b in zip(new[name], old[name], strict=True))
    ]
    for name in more:
        print(f"{name}: {old[name]} -> {new[name]}")
    if more and not accept:
        print(f"{len(more)} kernels do more than recorded; nothing written (--accept-more records it)")
        return 1
    lines = ",\n".join(f'  "{name}": {json.dumps(counts)}' for name, counts in sorted(new.items()))
    note = "operations of one evaluation: value, value and Jacobian; recorded by tools/record_operations.py"
    BOUNDS.write_text(f'{{\n "what": "{note}",\n "operations": {{\n{lines}\n }}\n}}\n', "utf-8")
    print(f"recorded {len(new)} formulas")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""JSON in which every value stands for itself: finite numbers, and no key twice in one object."""

from __future__ import annotations

import json
import math
from typing import NoReturn


def parsed_json(text: str | bytes) -> object:
    """What a text of JSON says.

    Raises:
        ValueError: it is not JSON, a number is not finite, or a key comes twice, one of whose values would be
            lost.
        RecursionError: it is nested too deeply.
    """
    return json.loads(text, parse_constant=_refused, parse_float=_number, object_pairs_hook=_once)


def _refused(name: str) -> NoReturn:
    raise ValueError(f"{name[:40]} is not a finite number")


def _number(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        _refused(text)
    return value


def _once(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """An object whose keys are all different."""
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {json.dumps(twice[:40])} comes twice in one object")
    return found

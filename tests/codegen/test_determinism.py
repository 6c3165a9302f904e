"""The same bytes, whatever the hash seed of the process and the order of formulas."""

import os
import subprocess
import sys

import pytest
from unchanged import Seen

from obseq.codegen.files import render_all, render_modules
from obseq.formulas import REGISTRY

SAMPLE = REGISTRY[::40]

PROGRAM = """
import hashlib, sys
from obseq.codegen.files import render_all, render_modules
from obseq.formulas import REGISTRY
texts = render_all(render_modules(REGISTRY[::40]))
print(hashlib.sha256(repr(sorted(texts.items())).encode()).hexdigest())
"""


@pytest.mark.slow
def test_the_hash_seed_changes_nothing(seen: Seen) -> None:
    if "hash seeds" in seen:
        return
    found = set()
    for seed in ("0", "20260"):
        environment = os.environ | {"PYTHONHASHSEED": seed}
        result = subprocess.run(
            [sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True
        )
        found.add(result.stdout)
    assert len(found) == 1
    seen.add("hash seeds")


def test_the_order_of_formulas_changes_nothing() -> None:
    few = SAMPLE
    assert render_all(render_modules(few)) == render_all(render_modules(few[::-1]))


def test_the_text_is_free_of_its_surroundings() -> None:
    for name, text in render_all(render_modules(SAMPLE)).items():
        assert "/root" not in text and "/home" not in text and "\r" not in text, name
        assert text.endswith("\n") and not text.endswith("\n\n")
        assert all(line == line.rstrip() for line in text.split("\n")), name

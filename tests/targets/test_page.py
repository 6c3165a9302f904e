"""The page of coded targets runs as it stands: from sheets to an adjusted block."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "targets.md"
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_the_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for language, text in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
        if language == "python":
            exec(compile(text, "targets.md", "exec"), names)
            continue
        for command in re.findall(r"^obseq (.*)$", text.replace("\\\n", " "), re.MULTILINE):
            assert main(shlex.split(command)) == 0, command
    record = json.loads((tmp_path / "block" / "bundle.json").read_text(encoding="utf-8"))
    assert 0.7 < record["sigma0"] < 1.4
    cameras = (tmp_path / "block" / "cameras.csv").read_text(encoding="utf-8").splitlines()
    focal = [float(line.split(",")[cameras[0].split(",").index("focal")]) for line in cameras[1:]]
    assert np.abs(np.array(focal) - [900.0, 915.0]).max() < 1.0

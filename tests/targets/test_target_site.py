"""The page on example 4 of the training runs as it stands, from photographs to the adjusted block."""

import importlib.util
import json
import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

from obseq.cli.main import main
from obseq.project import ProjectTree, read_image_measures, read_orientation

ROOT = Path(__file__).resolve().parents[2]
BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
def test_from_photographs_to_the_adjusted_block(tmp_path, monkeypatch, capsys) -> None:  # type: ignore[no-untyped-def]
    """With four of the twelve photographs."""
    maker = importlib.util.spec_from_file_location("maker", ROOT / "tools/make_target_site.py")
    assert maker is not None and maker.loader is not None
    module = importlib.util.module_from_spec(maker)
    maker.loader.exec_module(module)
    module.make_site(tmp_path, exposures=2)
    monkeypatch.chdir(tmp_path)
    said = ""
    blocks = BLOCK.findall((ROOT / "docs/targets-survey.md").read_text(encoding="utf-8"))
    for line in "".join(blocks[1:]).splitlines():
        if not line.startswith("obseq "):
            subprocess.run(["sh", "-euc", line], check=True)
            continue
        words = [str(next(Path().glob(word))) if "inputs/" in word else word for word in shlex.split(line)]
        assert main(words[1:]) in (0, 1), line
        said = capsys.readouterr().out
    truth = json.loads(Path("truth.json").read_text(encoding="utf-8"))
    tree = ProjectTree.at(".")
    poses, _ = read_orientation(tree.orientation("BA"))
    off = poses.centres - [truth["centres"][image] for image in poses.images]
    assert len(poses.images) == 4 and np.linalg.norm(off, axis=1).max() < 2e-3
    rms = re.search(r"image residuals +(\S+) +px rms", said)
    assert rms is not None and float(rms[1]) < 0.03
    families = [
        set(read_image_measures(tree.measures(name)).point_names) for name in ("TargetsC", "TargetsI")
    ]
    assert all(len(names) >= 6 for names in families)
    assert families[0] | families[1] <= truth["points"].keys()

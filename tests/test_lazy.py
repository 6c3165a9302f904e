"""Names of packages that are loaded when they are first used."""

import ast
import importlib
from pathlib import Path

import pytest

PACKAGES = (
    "obseq",
    "obseq.images",
    "obseq.images.aerial",
    "obseq.images.epipolar",
    "obseq.leastsquares",
    "obseq.project",
)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_name_is_found_and_no_other(name: str) -> None:
    package = importlib.import_module(name)
    assert [public for public in package.__all__ if getattr(package, public, None) is None] == []
    assert dir(package) == sorted(package.__all__)
    with pytest.raises(AttributeError, match=f"module '{name}' has no attribute 'nothing'"):
        package.nothing  # noqa: B018


@pytest.mark.parametrize("name", PACKAGES)
def test_type_checkers_see_the_same_names(name: str) -> None:
    package = importlib.import_module(name)
    tree = ast.parse(Path(str(package.__file__)).read_text(encoding="utf-8"))
    imported = {
        alias.name for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) for alias in node.names
    }
    assert imported - {"TYPE_CHECKING", "lazy_names"} == set(package.__all__)


@pytest.mark.parametrize(
    ("package", "former", "now"),
    [("obseq.images", "Pose", "RigidMotion"), ("obseq.leastsquares", "Pose", "UnknownPose")],
)
def test_former_names_work_and_warn(package: str, former: str, now: str) -> None:
    found = importlib.import_module(package)
    with pytest.warns(DeprecationWarning, match=f"from {package} import {now}"):
        assert getattr(found, former) is getattr(found, now)

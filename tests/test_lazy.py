"""Names of packages that are loaded when they are first used: the stub beside each says where they are."""

import importlib

import pytest

PACKAGES = (
    "obseq",
    "obseq.images",
    "obseq.images.aerial",
    "obseq.images.epipolar",
    "obseq.leastsquares",
    "obseq.project",
    "obseq.survey",
)


@pytest.mark.parametrize("name", PACKAGES)
def test_every_name_is_found_and_no_other(name: str) -> None:
    package = importlib.import_module(name)
    assert package.__all__
    assert [public for public in package.__all__ if getattr(package, public, None) is None] == []
    assert dir(package) == package.__all__ == sorted(package.__all__)
    with pytest.raises(AttributeError, match=f"{name} attribute nothing"):
        package.nothing  # noqa: B018

"""Small scenes that several tests look at."""

import pytest

from obseq.images import Camera
from obseq.targets import Conditions, Scene, Specification, made, photograph, random_sheets


@pytest.fixture(scope="session")
def camera() -> Camera:
    """A small camera with a wide view: perspective is seen."""
    return Camera("small", 480, 400, 700.0, [239.5, 199.5], distortion={"K1": -0.08})  # type: ignore[arg-type]


@pytest.fixture(scope="session")
def sets() -> dict[str, Specification]:
    """The four families."""
    families = ("CERN", "IGNIndoor", "IGNDroneSym", "IGNDroneTop")
    return {name: made(name) for name in families}


@pytest.fixture(scope="session")
def scene():  # type: ignore[no-untyped-def]
    """A function that makes an image of targets, and says where they are."""

    def take(camera, specs, count=6, sizes=(50.0, 80.0), tilts=(0.0, 45.0), seed=1, hidden=0.0, **seen):  # type: ignore[no-untyped-def]
        sheets = random_sheets(camera, specs, Scene(count, sizes, tilts, (110.0, 170.0), hidden, seed))
        return photograph(camera, sheets, Conditions(seed=seed, **seen))

    return take

"""Our dataclasses do what those of the standard library do."""

import copy
import dataclasses
import inspect
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError, field, replace
from typing import Any, ClassVar

import numpy as np
import pytest

from obseq.dataclass import dataclass


@dataclass(frozen=True)
class Place:
    """A point with a name."""

    name: str
    x: float = 0.0
    tags: list[str] = field(default_factory=list, compare=False)
    kind: ClassVar[str] = "place"


@dataclass(frozen=True)
class Peak(Place):
    height: float = 1.0


@dataclass
class Counter:
    count: int
    doubled: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.doubled = 2 * self.count


@dataclass(frozen=True, eq=False)
class Identity:
    values: Any


@dataclass(frozen=True, slots=True)
class Slotted:
    x: int


def twin(kind: type) -> Callable[..., Any]:
    """The same class by the standard library."""
    body = {"__annotations__": kind.__annotations__, "__module__": __name__}
    body |= {f.name: f for f in dataclasses.fields(kind) if f.name in kind.__annotations__}
    return dataclasses.dataclass(frozen=True)(type(kind.__name__, (), body))


def test_arguments_by_place_and_by_name() -> None:
    assert Place("A", 2.0, ["t"]) == Place(x=2.0, name="A", tags=["other"])
    assert (Place("A").x, Place("A").tags, Place.kind) == (0.0, [], "place")
    assert Place("A").tags is not Place("A").tags
    assert Peak("A", height=3.0) == Peak("A", 0.0, [], 3.0) != Place("A")


@pytest.mark.parametrize(
    ("given", "named", "message"),
    [
        ((), {}, "missing required arguments: 'name'"),
        (("A",), {"name": "B"}, "multiple values for argument 'name'"),
        (("A", 1.0, []), {"name": "B"}, "multiple values for argument 'name'"),
        (("A",), {"z": 1.0}, "unexpected keyword argument 'z'"),
        (("A", 1.0), {"z": 1.0}, "unexpected keyword argument 'z'"),
        (("A", 1.0, [], 3), {}, "takes 3 positional arguments but 4 were given"),
    ],
)
def test_wrong_arguments_are_named(given: tuple[Any, ...], named: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        Place(*given, **named)


def test_text_hash_and_order_of_fields_are_those_of_the_standard_library() -> None:
    standard = twin(Place)("A", 1.5, ["t"])
    ours = Place("A", 1.5, ["t"])
    assert repr(ours) == repr(standard) == "Place(name='A', x=1.5, tags=['t'])"
    assert hash(ours) == hash(standard) == hash(Place("A", 1.5))
    assert dataclasses.asdict(ours) == dataclasses.asdict(standard)
    assert str(inspect.signature(Place)) == str(inspect.signature(twin(Place))).replace(" -> None", "")
    assert Place.__match_args__ == ("name", "x", "tags")  # type: ignore[attr-defined]  # not of the plug-in


def test_frozen_ones_stay_as_they_are() -> None:
    with pytest.raises(FrozenInstanceError, match="cannot assign to field 'x'"):
        Place("A").x = 1.0  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError, match="cannot delete field 'x'"):
        del Place("A").x  # type: ignore[misc]
    with pytest.raises(FrozenInstanceError):
        Place("A").other = 1.0  # type: ignore[attr-defined]
    assert replace(Peak("A"), x=4.0) == Peak("A", 4.0)


def test_others_change_and_have_no_hash() -> None:
    counter = Counter(3)
    counter.count += 1
    assert counter == Counter(4) or counter.doubled == 6
    assert repr(counter) == "Counter(count=4)"
    with pytest.raises(TypeError, match="unhashable"):
        hash(counter)


def test_identity_where_equality_is_not_wanted() -> None:
    values = np.zeros(3)
    one = Identity(values)
    assert one == one != Identity(values)
    assert {one: 1}[one] == 1


def test_copies_and_pickles() -> None:
    place = Peak("A", 1.0, ["t"], 2.0)
    assert pickle.loads(pickle.dumps(place)) == copy.deepcopy(place) == copy.copy(place) == place


def test_slots_are_those_of_the_standard_library() -> None:
    assert not hasattr(Slotted(1), "__dict__")
    assert Slotted(1) == Slotted(x=1)


def test_a_class_without_words_is_called_by_its_name() -> None:
    """The standard library works out a signature instead, for which a start needs 4 ms."""
    assert (Identity.__doc__, Place.__doc__) == ("Identity", "A point with a name.")


@dataclass(frozen=True)
class Named(Place):
    """Fields that are given by name only come after those of the classes below."""

    height: float = field(default=0.0, kw_only=True)


@dataclass(frozen=True)
class Station(Named):
    instrument: str = "T2"


def test_fields_by_name_only_come_last() -> None:
    assert list(inspect.signature(Station).parameters) == ["name", "x", "tags", "instrument", "height"]
    station = Station("A", 1.0, ["old"], "T16", height=1.5)
    assert (station.instrument, station.height) == ("T16", 1.5)
    with pytest.raises(TypeError, match="got multiple values for argument 'instrument'"):
        Station("A", 1.0, ["old"], "T16", instrument="T2")

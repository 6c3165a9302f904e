"""What a person can read of a cause or a slip: one page each."""

from __future__ import annotations

from typing import Protocol

from obseq.dataclass import dataclass


class Cause(Protocol):
    """What causes of networks and of blocks have in common."""

    @property
    def code(self) -> str:
        """Stable code."""

    @property
    def name(self) -> str:
        """In one or two words."""

    @property
    def about(self) -> str:
        """What it means, in a sentence."""

    @property
    def example(self) -> str:
        """How it comes about."""

    @property
    def remedy(self) -> str:
        """What to do."""


@dataclass(frozen=True)
class Page:
    """What a code means.

    Attributes:
        code: Stable code, such as "S120".
        name: In a few words.
        about: What it means, in a sentence.
        tested: What is tested: where it may be, and what must fit; a sentence each.
        example: How it comes about.
        remedy: What to do.
    """

    code: str
    name: str
    about: str
    tested: tuple[str, ...]
    example: str
    remedy: str

    @classmethod
    def of(cls, cause: Cause, *tested: str) -> Page:
        """The page of a cause."""
        return cls(cause.code, cause.name, cause.about, tested, cause.example, cause.remedy)


def price(rarity: float) -> tuple[str, ...]:
    """What a cause that is rarer than one wrong reading must explain beyond it; nothing where it is not."""
    return (f"It must explain {rarity:g} (squared sigmas) more than one wrong reading.",) if rarity else ()

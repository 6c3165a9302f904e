"""What is asked of every formula, a family at a time: asking takes less time than a test of its own."""

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from obseq.formulas import REGISTRY, Formula


def family(formula: Formula) -> str:
    """The family that a formula belongs to: its module, which names the folder of what is generated."""
    return type(formula).__module__.rpartition(".")[2]


def of_each(formulas: Sequence[Formula] = REGISTRY) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Makes a test of one formula, its first argument, one of all formulas of a family.

    All are asked, and each that fails is named.
    """
    families: dict[str, list[Formula]] = {}
    for formula in formulas:
        families.setdefault(family(formula), []).append(formula)

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        _, *others = inspect.signature(test).parameters.values()

        @functools.wraps(test)
        def tested(formulas_of: str, **fixtures: Any) -> None:
            failures = []
            for formula in families[formulas_of]:
                try:
                    test(formula, **fixtures)
                except Exception as failure:
                    failure.add_note(f"This is of {formula.name}.")
                    failures.append(failure)
            if len(failures) == 1:
                raise failures[0]
            if failures:
                raise ExceptionGroup(f"formulas of {formulas_of}", failures)

        del tested.__wrapped__  # type: ignore[attr-defined]
        first = inspect.Parameter("formulas_of", inspect.Parameter.POSITIONAL_OR_KEYWORD)
        tested.__signature__ = inspect.Signature([first, *others])  # type: ignore[attr-defined]
        return pytest.mark.parametrize("formulas_of", sorted(families))(tested)

    return decorate

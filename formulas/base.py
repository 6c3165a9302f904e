"""What a formula is: a class whose `residual` declares, by its signature, unknowns and observations."""

import inspect
import re
import traceback
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import sympy

from obseq.cached import cached_property
from obseq.errors import FormulaError
from obseq.formulas.blocks import Atom, Declaration, Matrix3, Point2, Point3, Unit
from obseq.formulas.functions import Scalar
from obseq.formulas.naming import Patterned

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")

MOST_SCALARS = 1000
"""Unknowns and observations of a formula, beyond which no kernel is made: it would take hours to compile."""


@dataclass(frozen=True)
class Argument:
    """One argument of `residual`: its name, whether it is adjusted, and what it is made of."""

    name: str
    is_unknown: bool
    declaration: Declaration

    @property
    def scalars(self) -> tuple[str, ...]:
        """Names of its scalars, without its context."""
        return tuple(name for atom in self.declaration.atoms for name in atom.scalars)

    @property
    def context(self) -> tuple[str, ...]:
        """Names of its context values."""
        return tuple(name for atom in self.declaration.atoms for name in atom.context)


class Formula(Patterned):
    """Base of all formulas. A subclass writes `residual`; a family is a frozen dataclass with parameters.

    Attributes:
        pattern: The name of the members of a family, with the fields in braces (see `naming`).
        observation_order: Arguments in the order of their observed or context scalars, when MMVII's order is
            not "context of the unknown blocks first, then the observations".
        typical: Where the equation lives, for random checks: name of a scalar, an atomic block or an argument
            to (centre, half width).
        source: Where the equation comes from.
    """

    observation_order: ClassVar[tuple[str, ...]] = ()
    typical: ClassVar[Mapping[str, tuple[float, float]]] = {}
    source: ClassVar[str] = ""
    residual: Any

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of what `residual` gives; else each has the name of what was measured, or a number."""
        return ()

    @cached_property
    def arguments(self) -> tuple[Argument, ...]:
        """The arguments of `residual`, in the order of its signature.

        Raises:
            FormulaError: There is no `residual`, or an argument of it is no block.
        """
        if not hasattr(type(self), "residual"):
            raise FormulaError(f"{self.name}: the class has no method `residual`, which gives the residuals")
        hints = typing.get_type_hints(type(self).residual, include_extras=True)
        parameters = list(inspect.signature(type(self).residual).parameters.values())[1:]
        return tuple(
            Argument(
                parameter.name,
                parameter.kind is not inspect.Parameter.KEYWORD_ONLY,
                _declare(parameter.name, hints.get(parameter.name), self),
            )
            for parameter in parameters
        )

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of the unknowns, in order."""
        return tuple(name for argument in self.arguments if argument.is_unknown for name in argument.scalars)

    @property
    def observations(self) -> tuple[str, ...]:
        """Names of the observations, context of the unknown blocks included, in order."""
        return tuple(name for names in self._observed().values() for name in names)

    @property
    def measured(self) -> tuple[str, ...]:
        """Names of the observations that are not the context of an unknown block."""
        return tuple(
            name for argument in self.arguments if not argument.is_unknown for name in argument.scalars
        )

    @property
    def atoms(self) -> tuple[tuple[str, Atom], ...]:
        """The atomic unknown blocks, each with its name: the argument, and its part when it has several."""
        return tuple(
            (f"{argument.name}.{atom.part}" if len(argument.declaration.atoms) > 1 else argument.name, atom)
            for argument in self.arguments
            if argument.is_unknown
            for atom in argument.declaration.atoms
        )

    def _observed(self) -> dict[str, tuple[str, ...]]:
        observed = {
            argument.name: argument.context if argument.is_unknown else argument.scalars
            for argument in self.arguments
        }
        observed = {name: names for name, names in observed.items() if names}
        if not self.observation_order:
            return observed
        if set(self.observation_order) != set(observed):
            raise FormulaError(f"{self.name}: observation_order must name exactly {sorted(observed)}")
        return {name: observed[name] for name in self.observation_order}

    def evaluate(self, unknowns: Sequence[Scalar], observations: Sequence[Scalar]) -> tuple[Scalar, ...]:
        """The residuals, read on whatever is given: floats, mpmath numbers or sympy symbols."""
        values = dict(zip(self.unknowns, unknowns, strict=True))
        values |= zip(self.observations, observations, strict=True)
        positional, keyword = [], {}
        for argument in self.arguments:
            built = argument.declaration.build(
                [values[name] for name in argument.scalars], [values[name] for name in argument.context]
            )
            if argument.is_unknown:
                positional.append(built)
            else:
                keyword[argument.name] = built
        residual = self.residual(*positional, **keyword)
        if residual is None:
            raise FormulaError(f"{self.name}: its `residual` gives nothing: does it end without `return`?")
        return _flatten(residual)

    def expressions(self) -> tuple[sympy.Expr, ...]:
        """The residuals as unevaluated sympy expressions of the named unknowns and observations.

        Raises:
            FormulaError: `residual` fails, gives nothing, or takes symbols for numbers.
        """
        self.check_names()
        unknowns, observations = (
            [sympy.Symbol(name, real=True) for name in names] for names in (self.unknowns, self.observations)
        )
        with sympy.evaluate(False):
            try:
                return tuple(map(sympy.sympify, self.evaluate(unknowns, observations)))
            except TypeError as error:
                raise FormulaError(
                    f"{self.name}: its residual is no equation of symbols: {error}. It is written with the "
                    "functions of obseq.formulas.functions, not those of math or numpy, and has no conditions"
                ) from error
            except (ArithmeticError, AttributeError, LookupError, NameError, ValueError) as error:
                place = traceback.extract_tb(error.__traceback__)[-1]
                raise FormulaError(
                    f"{self.name}: its residual fails: {error} ({place.filename}, line {place.lineno})"
                ) from error

    def check_names(self) -> None:
        """Raises FormulaError when there are too many scalars, or a name is repeated or no identifier."""
        names = (*self.unknowns, *self.observations)
        if len(names) > MOST_SCALARS:
            raise FormulaError(
                f"{self.name}: {len(names)} unknowns and observations are too many; "
                f"formulas have at most {MOST_SCALARS}"
            )
        seen: set[str] = set()
        for name in names:
            if not IDENTIFIER.fullmatch(name):
                raise FormulaError(f"{self.name}: the scalar name {name!r} is not an identifier")
            if name in seen:
                raise FormulaError(f"{self.name}: the scalar name {name!r} is declared twice")
            seen.add(name)


def _declare(argument: str, annotation: object, formula: Formula) -> Declaration:
    """The declaration of one argument from its annotation: a block type, with labels when it is Annotated."""
    block, labels = annotation, [argument]
    if typing.get_origin(annotation) is typing.Annotated:
        block, *labels = typing.get_args(annotation)
    if not hasattr(block, "declare"):
        raise FormulaError(
            f"{formula.name}: the argument {argument!r} is not annotated with a block type "
            f"({argument}: Point3, say; see obseq.formulas.blocks)"
        )
    units = [label.name for label in labels if isinstance(label, Unit)]
    labels = [label for label in labels if not isinstance(label, Unit)] or [argument]
    declaration: Declaration = block.declare(labels, formula)
    if units:
        atoms = tuple(replace(atom, unit=units[0]) for atom in declaration.atoms)
        return replace(declaration, atoms=atoms)
    return declaration


def _flatten(residual: object) -> tuple[Scalar, ...]:
    """The scalars of a residual written as a scalar, a point, a matrix, or a sequence of these."""
    if isinstance(residual, Point2 | Point3 | Matrix3):
        return tuple(residual)
    if isinstance(residual, tuple | list):
        return tuple(scalar for part in residual for scalar in _flatten(part))
    return (residual,)

"""Operations of value and Jacobian beside those of CasADi, SymForce, wrenfold and sympy, for ten formulas.

    python tools/benchmarks/bench_operations.py

Each other program gets the same expressions and differentiates and shares by its own means: CasADi by
`jacobian` and `cse`, SymForce by `jacobian` and its `cse`, wrenfold by `jacobian` and
`eliminate_subexpressions`, sympy by `diff` and `cse`. An operation is an addition, a product, a quotient, a
root, a power or a call; a sum of n terms is n - 1. Angles are compared without their whole turns, which the
others have not. What is not installed has an empty column (`pip install casadi symforce wrenfold`).
"""

import importlib.util
from collections.abc import Callable

import sympy
from command import command_line

from obseq.codegen.compiler import derive
from obseq.formulas import Formula, formula
from obseq.formulas import functions as ours

NAMES = (
    "Dist3D",
    "TopoHz",
    "TopoZen",
    "TopoDist",
    "TopoSubFrame",
    "BlocRigid",
    "Clino_0_3",
    "EqDist_Dist_Rad3_Dec1_XY1",
    "EqColinearityCamPPC_Stenope_Dist_Rad0_Dec0_XY0",
    "EqColinearityCamPPC_Stenope_Dist_Rad3_Dec1_XY1",
)


def plain(expression: sympy.Expr) -> sympy.Expr:
    """An expression of functions that everybody has."""
    expression = expression.replace(ours.Named, lambda name, value: value)
    return expression.replace(ours.WrapAngle, lambda angle: angle).replace(ours.Sqrt, sympy.sqrt)


def with_casadi(one: Formula, residuals: list[sympy.Expr]) -> int:
    """Instructions of CasADi's function."""
    import casadi

    scalars = [sympy.Symbol(name, real=True) for name in (*one.unknowns, *one.observations)]
    names = ("sqrt", "sin", "cos", "tan", "asin", "atan2")
    evaluate = sympy.lambdify(scalars, residuals, modules=[{name: getattr(casadi, name) for name in names}])
    unknowns = [casadi.SX.sym(name) for name in one.unknowns]
    observations = [casadi.SX.sym(name) for name in one.observations]
    values, x = casadi.vertcat(*evaluate(*unknowns, *observations)), casadi.vertcat(*unknowns)
    results = casadi.cse([values, casadi.densify(casadi.jacobian(values, x))])
    function = casadi.Function("f", [x, casadi.vertcat(*observations)], results)
    idle = (casadi.OP_INPUT, casadi.OP_OUTPUT, casadi.OP_CONST)
    return sum(function.instruction_id(k) not in idle for k in range(function.n_instructions()))


def with_symforce(one: Formula, residuals: list[sympy.Expr]) -> int:
    """Operations of SymForce's common subexpressions and what is left, of symengine."""
    import symforce.symbolic as sf

    scalars = [sympy.Symbol(name, real=True) for name in (*one.unknowns, *one.observations)]
    names = ("sqrt", "sin", "cos", "tan", "asin", "atan2")
    evaluate = sympy.lambdify(scalars, residuals, modules=[{name: getattr(sf.sympy, name) for name in names}])
    symbols = [sf.Symbol(symbol.name) for symbol in scalars]
    values = evaluate(*symbols)
    jacobian = sf.Matrix(values).jacobian(sf.Matrix(symbols[: len(one.unknowns)]))
    parts, shared = sf.cse([*values, *jacobian])
    return sum(int(sympy.count_ops(sympy.sympify(value))) for _, value in parts) + sum(
        int(sympy.count_ops(sympy.sympify(value))) for value in shared
    )


def with_wrenfold(one: Formula, residuals: list[sympy.Expr]) -> int:
    """Operations of wrenfold's expressions after it has taken out what they share."""
    from wrenfold import sym, sympy_conversion

    values = sym.vector(*(sympy_conversion.from_sympy(value) for value in residuals))
    symbols = [sympy_conversion.from_sympy(sympy.Symbol(name, real=True)) for name in one.unknowns]
    jacobian = sym.jacobian(values, symbols)
    whole = sym.vstack([values, *(jacobian[:, k] for k in range(len(symbols)))])
    shared, parts = sym.eliminate_subexpressions(whole)
    expressions = [value for _, value in parts] + [shared[k] for k in range(whole.shape[0])]
    return sum(map(_operations, expressions))


def _operations(expression: object) -> int:
    """Operations of a wrenfold expression: n - 1 of sums and products of n, one of anything else."""
    arguments = getattr(expression, "args", ())
    inner = sum(map(_operations, arguments))
    if not arguments:
        return 0
    is_row = expression.type_name in ("Addition", "Multiplication")  # type: ignore[attr-defined]
    return inner + (len(arguments) - 1 if is_row else 1)


def with_sympy(one: Formula, residuals: list[sympy.Expr]) -> int:
    """Operations of sympy's common subexpressions and what is left."""
    unknowns = [sympy.Symbol(name, real=True) for name in one.unknowns]
    whole = [*residuals, *(sympy.diff(value, x) for value in residuals for x in unknowns)]
    parts, shared = sympy.cse(whole)
    return sum(int(sympy.count_ops(value)) for value in [*(value for _, value in parts), *shared])


OTHERS: dict[str, Callable[[Formula, list[sympy.Expr]], int]] = {
    "casadi": with_casadi,
    "symforce": with_symforce,
    "wrenfold": with_wrenfold,
    "sympy": with_sympy,
}


def main() -> int:
    """Prints the table."""
    command_line(__doc__).parse_args()
    width = max(map(len, NAMES))
    print(f"{'formula':<{width}} {'obseq':>8}" + "".join(f" {name:>9}" for name in OTHERS))
    for name in NAMES:
        one = formula(name)
        residuals = [plain(value) for value in one.expressions()]
        cells = []
        for package, count in OTHERS.items():
            there = importlib.util.find_spec(package) is not None
            cells.append(f"{count(one, residuals):>9}" if there else " " * 9)
        print(f"{name:<{width}} {derive(one).counts[1]:>8} " + " ".join(cells))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

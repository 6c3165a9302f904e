"""A solution for people and for other programs: a summary, JSON, and columns for tables."""

from __future__ import annotations

import importlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from obseq.errors import InputError
from obseq.geometry import logarithm
from obseq.leastsquares.problem.unknowns import Kind

if TYPE_CHECKING:
    from obseq.arrays import FloatArray
    from obseq.leastsquares.solution.result import LeastSquaresResult


FORMAT = "obseq-least-squares"
VERSION = 1


def unknown_columns(result: LeastSquaresResult) -> dict[str, Any]:
    """Columns with one row per scalar unknown: name, value, precision, frozen.

    The value of a component of a rotation is that of its rotation vector, of a direction that of the small
    displacement, 0. Precisions are NaN when covariances were not asked for; they are a posteriori, or a
    priori when there is no redundancy.
    """
    table, state = result._table, result._state
    scalars = np.arange(table.n_scalars)
    values = np.array(state.values[: table.n_scalars])
    rotations = np.flatnonzero(table.kind == Kind.ROTATION)
    if rotations.size:
        places = table.start[rotations][:, None] + np.arange(3)
        values[places] = logarithm(table.read(rotations, state))
    precisions = np.full(table.n_scalars, np.nan)
    if result._cofactors is not None:
        precisions = np.sqrt(_scale(result) * result._cofactors.variances())
    return {
        "name": list(table.component_names(scalars)),
        "value": values,
        "precision": precisions,
        "frozen": np.array(table.frozen[: table.n_scalars]),
    }


def observation_columns(result: LeastSquaresResult) -> dict[str, Any]:
    """Columns with one row per scalar residual: formula, observation, residual, sigma, normalised, weight.

    The weight is that of the robust loss: 1 full, 0 none; 0 too for inactive observations.
    """
    columns: dict[str, list[Any]] = {key: [] for key in ("formula", "observation", "residual_name")}
    numbers: dict[str, list[FloatArray]] = {key: [] for key in ("residual", "sigma", "normalised", "weight")}
    for batch, residuals in result._residuals.items():
        m = batch.shape.n_residuals
        labels = [batch.label(row) for row in range(batch.n)]
        columns["formula"] += [batch.name] * (batch.n * m)
        columns["observation"] += [label for label in labels for _ in range(m)]
        columns["residual_name"] += [str(k) for k in range(m)] * batch.n
        numbers["residual"].append(residuals.ravel())
        numbers["sigma"].append(np.broadcast_to(batch.sigmas, residuals.shape).ravel())
        numbers["normalised"].append(result.normalised_residuals(batch).ravel())
        numbers["weight"].append(np.repeat(batch.robust_weights(), m))
    joined = {key: np.concatenate(parts) if parts else np.zeros(0) for key, parts in numbers.items()}
    return {**columns, **joined}


def to_dict(result: LeastSquaresResult) -> dict[str, Any]:
    """The whole solution as plain values, versioned; numbers that are not defined are None."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "n_observations": result.n_observations,
        "n_constraints": result.n_constraints,
        "n_unknowns": result.n_unknowns,
        "redundancy": result.redundancy,
        "sigma0": result.sigma0,
        "converged": result.converged,
        "stop_reason": result.stop_reason.value,
        "iterations": [{"sigma0": step.sigma0, "max_step": step.max_step} for step in result.iterations],
        "squares": dict(result.squares),
        "precision": "a priori" if result.variance_factor is None else "a posteriori",
        "unknowns": _rows(unknown_columns(result)),
        "observations": _rows(observation_columns(result)),
    }


def to_json(result: LeastSquaresResult) -> str:
    """`to_dict` as JSON text, floats at full precision."""
    return json.dumps(to_dict(result), ensure_ascii=False, allow_nan=False, indent=1)


def summary(result: LeastSquaresResult, worst: int = 5) -> str:
    """A few lines on the solution: counts, sigma0, why the iterations ended, worst normalised residuals."""
    sigma0 = "undefined (no redundancy)" if result.sigma0 is None else f"{result.sigma0:.6g}"
    lines = [
        f"{result.n_observations} observations, {result.n_constraints} constraints, "
        f"{result.n_unknowns} unknowns: redundancy {result.redundancy}",
        f"sigma0 {sigma0}; {len(result.iterations)} iterations, {result.stop_reason.value}",
    ]
    lines += [f"  {group}: sum of squares {square:.6g}" for group, square in result.squares.items()]
    columns = observation_columns(result)
    order = np.argsort(-np.abs(np.nan_to_num(columns["normalised"])))[:worst]
    lines += [f"  {columns['observation'][k]}: {columns['normalised'][k]:+.2f} sigma" for k in order]
    return "\n".join(lines) + "\n"


def as_table(columns: dict[str, Any], package: str) -> Any:
    """Columns as a table of a package: "pandas" (DataFrame) or "pyarrow" (Table).

    Raises:
        InputError: The package is another one, or it is not installed.
    """
    if package not in ("pandas", "pyarrow"):
        raise InputError(f"unknown table package {package!r}; known: pandas, pyarrow")
    try:
        module = importlib.import_module(package)
    except ImportError:
        raise InputError(f"tables of {package} need the package: pip install {package}") from None
    return module.DataFrame(columns) if package == "pandas" else module.table(columns)


def _scale(result: LeastSquaresResult) -> float:
    return 1.0 if result.variance_factor is None else result.variance_factor


def _rows(columns: dict[str, Any]) -> list[dict[str, Any]]:
    plain = [column.tolist() if isinstance(column, np.ndarray) else column for column in columns.values()]
    return [
        {key: _defined(value) for key, value in zip(columns, row, strict=True)}
        for row in zip(*plain, strict=True)
    ]


def _defined(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value

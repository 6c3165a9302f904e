"""A solution for other programs: columns of unknowns and observations, tables, plain values."""

from __future__ import annotations

import importlib
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np

from obseq.arrays import BoolArray, FloatArray
from obseq.errors import InputError
from obseq.leastsquares.problem.batches import Batch
from obseq.leastsquares.problem.unknowns import State, UnknownTable
from obseq.leastsquares.problem.weights import Weighing

Columns: TypeAlias = "Mapping[str, list[str] | FloatArray | BoolArray]"


def unknown_columns(
    table: UnknownTable, state: State, frozen: BoolArray, precisions: FloatArray | None
) -> Columns:
    """Columns with one row per scalar unknown: name, value, precision, frozen.

    The value of a component of a rotation is that of its rotation vector, of a direction that of the small
    displacement, 0.

    Args:
        table: names and kinds.
        state: values of its first n scalar unknowns.
        frozen: (n,) whether they kept their values.
        precisions: (n,) standard deviations; NaN where None.
    """
    n = len(state.values)
    values = np.array(state.values)
    for manifold, ids in table.of_manifolds():
        there = ids[table.start[ids] < n]
        if there.size and not manifold.is_flat:
            values[table.scalars(there)] = manifold.coordinates(table.read(there, state))
    return {
        "name": list(table.component_names(np.arange(n))),
        "value": values,
        "precision": np.full(n, np.nan) if precisions is None else precisions,
        "frozen": np.array(frozen),
    }


def observation_columns(parts: Iterable[tuple[Batch, FloatArray, Weighing]]) -> Columns:
    """Columns with one row per scalar residual: formula, observation, residual, sigma, normalised, weight.

    The weight is that of the robust loss: 1 full, 0 none; 0 too for inactive observations.

    Args:
        parts: batches with their residuals (n, n_residuals), and what these were weighed by.
    """
    columns: dict[str, list[str]] = {key: [] for key in ("formula", "observation", "residual_name")}
    numbers: dict[str, list[FloatArray]] = {key: [] for key in ("residual", "sigma", "normalised", "weight")}
    for batch, residuals, weighing in parts:
        m = batch.shape.n_residuals
        labels = [batch.label(row) for row in range(batch.n)]
        columns["formula"] += [batch.name] * (batch.n * m)
        columns["observation"] += [label for label in labels for _ in range(m)]
        columns["residual_name"] += [str(k) for k in range(m)] * batch.n
        numbers["residual"].append(residuals.ravel())
        numbers["sigma"].append(weighing.sigmas.ravel())
        numbers["normalised"].append((weighing.whitened_residuals(residuals) / weighing.sigmas).ravel())
        numbers["weight"].append(np.repeat(weighing.robust_weights(), m))
    joined = {key: np.concatenate(parts) if parts else np.zeros(0) for key, parts in numbers.items()}
    return {**columns, **joined}


def as_table(columns: Columns, package: str) -> Any:
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


def rows(columns: Columns) -> list[dict[str, object]]:
    """Columns as rows of plain values; numbers that are not defined are None."""
    plain = [column.tolist() if isinstance(column, np.ndarray) else column for column in columns.values()]
    return [
        {key: _defined(value) for key, value in zip(columns, row, strict=True)}
        for row in zip(*plain, strict=True)
    ]


def _defined(value: object) -> object:
    return None if isinstance(value, float) and not np.isfinite(value) else value

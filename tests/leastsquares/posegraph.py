"""Pose graphs: reading g2o files, the equation of a relative pose, and the chordal start."""

import functools
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from obseq.codegen import compile_formula
from obseq.formulas.base import Formula
from obseq.formulas.blocks import Angle, Matrix3, Point2, Point3, Pose, Vector
from obseq.formulas.functions import Scalar, angle_difference, angle_ratio, cos, sin
from obseq.leastsquares import LeastSquares


@dataclass(frozen=True)
class Graph:
    """Poses and edges: rotations (n, d, d), translations (n, d), upper roots of the informations."""

    translations: np.ndarray
    rotations: np.ndarray
    starts: np.ndarray
    ends: np.ndarray
    edge_translations: np.ndarray
    edge_rotations: np.ndarray
    roots: np.ndarray

    @property
    def dimension(self):
        return self.translations.shape[1]


def read_graph(path):
    """A g2o file; vertices are numbered from 0 in the order of their ids."""
    lines = [line.split() for line in path.read_text().splitlines() if line.strip()]
    vertices = {int(f[1]): [float(x) for x in f[2:]] for f in lines if f[0].startswith("VERTEX")}
    number = {vertex: k for k, vertex in enumerate(sorted(vertices))}
    edges = [f for f in lines if f[0].startswith("EDGE")]
    poses = np.array([vertices[vertex] for vertex in sorted(vertices)])
    measured = np.array([[float(x) for x in f[3:]] for f in edges])
    flat = poses.shape[1] == 3
    size = 3 if flat else 6
    to_pose = plane_pose if flat else space_pose
    translations, rotations = to_pose(poses)
    edge_translations, edge_rotations = to_pose(measured[:, : poses.shape[1]])
    information = np.zeros((len(edges), size, size))
    rows, columns = np.triu_indices(size)
    information[:, rows, columns] = information[:, columns, rows] = measured[:, poses.shape[1] :]
    return Graph(
        translations,
        rotations,
        np.array([number[int(f[1])] for f in edges]),
        np.array([number[int(f[2])] for f in edges]),
        edge_translations,
        edge_rotations,
        np.linalg.cholesky(information).transpose(0, 2, 1),
    )


def plane_pose(rows):
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    return rows[:, :2], np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], 1)


def space_pose(rows):
    x, y, z, w = (rows[:, 3:7] / np.linalg.norm(rows[:, 3:7], axis=1, keepdims=True)).T
    entries = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return rows[:, :3], np.stack([np.stack(row, -1) for row in entries], 1)


def upper(size):
    """Names of the entries of an upper triangular matrix, row by row."""
    return tuple(f"u_{i}_{j}" for i in range(size) for j in range(i, size))


def whitened(root, errors):
    """An upper triangular matrix times a vector."""
    entries = iter(root)
    return [sum(next(entries) * error for error in errors[i:]) for i in range(len(errors))]


class RelativePose2(Formula):
    """Pose of a second frame seen from a first one in the plane, whitened by the root of its information."""

    root_names = upper(3)

    def residual(
        self,
        start: Annotated[Point2, "ti"],
        start_angle: Annotated[Angle, "ai"],
        end: Annotated[Point2, "tj"],
        end_angle: Annotated[Angle, "aj"],
        *,
        translation: Annotated[Point2, "d"],
        angle: Annotated[Angle, "da"],
        root: Annotated[Vector, "root_names"],
    ) -> list[Scalar]:
        """Translation in the measured frame, and angle."""
        seen = turned_back(start_angle, end - start)
        gap = turned_back(angle, seen - translation)
        return whitened(root, [gap.x, gap.y, angle_difference(end_angle - start_angle, angle)])


def turned_back(angle, vector):
    c, s = cos(angle), sin(angle)
    return Point2(c * vector.x + s * vector.y, c * vector.y - s * vector.x)


class RelativePose3(Formula):
    """Pose of a second frame seen from a first one in space, whitened by the root of its information."""

    root_names = upper(6)

    def residual(
        self,
        start: Annotated[Pose, "Ci", "Wi", "Ri"],
        end: Annotated[Pose, "Cj", "Wj", "Rj"],
        *,
        translation: Annotated[Point3, "d"],
        rotation: Annotated[Matrix3, "Rz"],
        root: Annotated[Vector, "root_names"],
    ) -> list[Scalar]:
        """Translation in the measured frame, and the rotation vector of what is left."""
        gap = rotation.T @ (start.inverse() @ end.centre - translation)
        axes = [rotation.T @ (start.rotation.inverse() @ axis) for axis in end.rotation.matrix().columns()]
        return whitened(root, [*gap, *rotation_vector(*axes)])


def rotation_vector(i, j, k):
    """Rotation vector of the matrix with these columns; smooth at the identity."""
    sine = Point3(0.5 * (j.z - k.y), 0.5 * (k.x - i.z), 0.5 * (i.y - j.x))
    cosine = 0.5 * (i.x + j.y + k.z - 1)
    return angle_ratio(sine.dot(sine), cosine) * sine


@functools.cache
def kernel_of(formula):
    """The kernel of a formula of this module, compiled once for all tests."""
    return compile_formula(formula())


def adjusted(graph, translations, rotations, **options):
    """The adjusted graph, its first pose frozen, and its cost chi2."""
    system = LeastSquares()
    names = [f"pose {k}" for k in range(len(translations))]
    points = system.add_points(names, translations)
    rows, columns = np.triu_indices(graph.roots.shape[1])
    roots = graph.roots[:, rows, columns]
    ends = (graph.starts, graph.ends)
    if graph.dimension == 2:
        turns = system.add_scalars(names, np.arctan2(rotations[:, 1, 0], rotations[:, 0, 0]))
        angles = np.arctan2(graph.edge_rotations[:, 1, 0], graph.edge_rotations[:, 0, 0])
        observed = np.column_stack([graph.edge_translations, angles, roots])
        roles, formula = ("start", "start_angle", "end", "end_angle"), RelativePose2
    else:
        turns = system.add_rotations(names, rotations)
        observed = np.column_stack([graph.edge_translations, graph.edge_rotations.reshape(-1, 9), roots])
        roles, formula = ("start.centre", "start.rotation", "end.centre", "end.rotation"), RelativePose3
    blocks = dict(zip(roles, (points[ends[0]], turns[ends[0]], points[ends[1]], turns[ends[1]]), strict=True))
    system.add(kernel_of(formula), blocks, observed, 1.0)
    system.freeze(points[:1])
    system.freeze(turns[:1])
    return system.solve(**options)


def chordal_start(graph):
    """Rotations from linear equations R_j = R_i R_ij, then translations from linear equations."""
    d = graph.dimension
    system = LeastSquares()
    n = len(graph.translations)
    ids = system.add_vectors([f"R{k}" for k in range(n)], np.tile(np.eye(d).ravel(), (n, 1)))
    system.freeze(ids[:1])
    for row in range(d):
        for column in range(d):
            coefficient = np.zeros((len(graph.starts), d * d))
            coefficient[:, row * d : row * d + d] = -graph.edge_rotations[:, :, column]
            unit = np.zeros_like(coefficient)
            unit[:, row * d + column] = 1.0
            zeros = np.zeros(len(graph.starts))
            system.add_linear([ids[graph.starts], ids[graph.ends]], [coefficient, unit], zeros, 1.0)
    found = system.solve().values(ids).reshape(n, d, d)
    u, _, v = np.linalg.svd(found)
    u[:, :, -1] *= np.linalg.det(u @ v)[:, None]
    rotations = graph.rotations[0] @ (u @ v)
    return linear_translations(graph, rotations), rotations


def linear_translations(graph, rotations):
    """Translations that fit the edges best when rotations are kept."""
    system = LeastSquares()
    points = system.add_points([f"t{k}" for k in range(len(rotations))], graph.translations)
    system.freeze(points[:1])
    moved = np.einsum("nij,nj->ni", rotations[graph.starts], graph.edge_translations)
    for component in range(graph.dimension):
        unit = np.zeros_like(moved)
        unit[:, component] = 1.0
        system.add_linear([points[graph.starts], points[graph.ends]], [-unit, unit], moved[:, component], 1.0)
    return system.solve().values(points)

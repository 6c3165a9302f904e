"""The blocks that formulas are written with, and how each one declares its scalars.

A block in the signature of `residual` is annotated with its type, and with MMVII's names for its scalars:
`station: Annotated[Pose, "Ci", "Wi", "mi"]`. Unknown blocks may also bring context: values of the current
solution that are constant in the equation (current matrix of a rotation, tangent frame of a direction).

Small rotations (one convention for all formulas, MMVII's `cRot3dF`): a rotation from the local frame of an
instrument or of a camera to the world is `R = R0 (I - [w]x)`, with `R0` its current matrix (context) and
`w` the unknown, 0 whenever an adjustment evaluates it. Its inverse is taken as its transpose,
`(I + [w]x) R0^T`. After a solution `R0` becomes `R0 exp(-[w]x)` and `w` returns to 0.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self, overload

from obseq.formulas.declarations import WORLD_TO_LOCAL as WORLD_TO_LOCAL
from obseq.formulas.declarations import Atom as Atom
from obseq.formulas.declarations import Declaration as Declaration
from obseq.formulas.declarations import Unit as Unit
from obseq.formulas.declarations import component_names as component_names
from obseq.formulas.declarations import matrix_names as matrix_names
from obseq.formulas.functions import Scalar, let, sqrt


class Number(Scalar):  # type: ignore[misc]  # to the reader of a formula it is a scalar
    """A scalar without a unit."""

    unit = ""

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """One scalar, named by the label."""
        (name,) = labels
        return Declaration((Atom("Scalar", (name,), unit=cls.unit),), lambda scalars, _: scalars[0])


class Length(Number):
    """A length in metres."""

    unit = "m"


class Angle(Number):
    """An angle in radians."""

    unit = "rad"


class Pixel(Number):
    """A position or a length in an image, in pixels."""

    unit = "pixel"


class Radiometry(Number):
    """A grey level."""

    unit = "grey level"


class Vector(tuple[Scalar, ...]):
    """Several scalars; their names are an attribute of the formula, given by its name: `"coefficients"`."""

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Scalars named by an attribute of the formula, or by the labels when there are several."""
        names = tuple(labels) if len(labels) > 1 else tuple(getattr(formula, labels[0]))
        return Declaration((Atom("Vector", names),) if names else (), lambda scalars, _: tuple(scalars))


@dataclass(frozen=True)
class Point2:
    """A point or a vector of the plane."""

    x: Scalar
    y: Scalar

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Two scalars `label_x`, `label_y`."""
        names = component_names(labels, "xy")
        return Declaration((Atom("Point2", names),), lambda scalars, _: cls(*scalars))

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.x, self.y))

    def __add__(self, other: "Point2") -> "Point2":
        return Point2(self.x + other.x, self.y + other.y)

    def __sub__(self, other: "Point2") -> "Point2":
        return Point2(self.x - other.x, self.y - other.y)

    def __rmul__(self, factor: Scalar) -> "Point2":
        return Point2(factor * self.x, factor * self.y)

    def dot(self, other: "Point2") -> Scalar:
        """Scalar product."""
        return self.x * other.x + self.y * other.y

    def with_names(self, name: str) -> "Point2":
        """The same point, its components named for the generated code."""
        return Point2(let(f"{name}_x", self.x), let(f"{name}_y", self.y))


class Points2(tuple[Point2, ...]):
    """Several points of the plane, each an atomic block."""

    __slots__ = ()

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Points named by patterns of x and y (`"x_P{}"`), as many as the attribute (third label) says."""
        x, y, number = labels
        count = getattr(formula, number)
        atoms = (Atom("Point2", (x.format(k), y.format(k)), part=str(k)) for k in range(count))

        def build(scalars: Sequence[Scalar], context: Sequence[Scalar]) -> Points2:
            return cls(Point2(*scalars[2 * k : 2 * k + 2]) for k in range(count))

        return Declaration(tuple(atoms), build)


@dataclass(frozen=True)
class Point3:
    """A point or a vector of space."""

    x: Scalar
    y: Scalar
    z: Scalar

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Three scalars `label_x`, `label_y`, `label_z`."""
        names = component_names(labels, "xyz")
        return Declaration((Atom("Point3", names, unit="m"),), lambda scalars, _: cls(*scalars))

    def __iter__(self) -> Iterator[Scalar]:
        return iter((self.x, self.y, self.z))

    def __add__(self, other: "Point3") -> "Point3":
        return Point3(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: "Point3") -> "Point3":
        return Point3(self.x - other.x, self.y - other.y, self.z - other.z)

    def __rmul__(self, factor: Scalar) -> "Point3":
        return Point3(factor * self.x, factor * self.y, factor * self.z)

    def dot(self, other: "Point3") -> Scalar:
        """Scalar product."""
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: "Point3") -> "Point3":
        """Vector product."""
        return Point3(
            self.y * other.z - self.z * other.y,
            self.z * other.x - self.x * other.z,
            self.x * other.y - self.y * other.x,
        )

    def with_names(self, name: str) -> "Point3":
        """The same point, its components named for the generated code."""
        return Point3(let(f"{name}_x", self.x), let(f"{name}_y", self.y), let(f"{name}_z", self.z))


def norm(vector: Point2 | Point3) -> Scalar:
    """Euclidean length; its derivative is undefined for the zero vector."""
    return sqrt(vector.dot(vector))  # type: ignore[arg-type]


@dataclass(frozen=True)
class Matrix3:
    """A 3 x 3 matrix, held row by row."""

    rows: tuple[Point3, Point3, Point3]

    @classmethod
    def from_scalars(cls, scalars: Sequence[Scalar]) -> Self:
        """The matrix of nine scalars given row by row."""
        return cls((Point3(*scalars[0:3]), Point3(*scalars[3:6]), Point3(*scalars[6:9])))

    @classmethod
    def from_columns(cls, a: Point3, b: Point3, c: Point3) -> Self:
        """The matrix whose columns are given."""
        return cls((Point3(a.x, b.x, c.x), Point3(a.y, b.y, c.y), Point3(a.z, b.z, c.z)))

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Nine scalars `label_column_row`, row by row."""
        (prefix,) = labels
        return Declaration(
            (Atom("Matrix3", matrix_names(prefix)),), lambda scalars, _: cls.from_scalars(scalars)
        )

    @property
    def T(self) -> "Matrix3":  # noqa: N802  (the mathematical name)
        """The transpose."""
        return Matrix3.from_columns(*self.rows)

    def columns(self) -> tuple[Point3, Point3, Point3]:
        """The three columns."""
        return self.T.rows

    def __iter__(self) -> Iterator[Scalar]:
        return (scalar for row in self.rows for scalar in row)

    def __sub__(self, other: "Matrix3") -> "Matrix3":
        (a, b, c), (d, e, f) = self.rows, other.rows
        return Matrix3((a - d, b - e, c - f))

    @overload
    def __matmul__(self, other: Point3) -> Point3: ...

    @overload
    def __matmul__(self, other: "Matrix3") -> "Matrix3": ...

    def __matmul__(self, other: "Point3 | Matrix3") -> "Point3 | Matrix3":
        if isinstance(other, Matrix3):
            return Matrix3.from_columns(*(self @ column for column in other.columns()))
        a, b, c = self.rows
        return Point3(a.dot(other), b.dot(other), c.dot(other))


@dataclass(frozen=True)
class Rotation:
    """A rotation from a local frame to the world, `R0 (I - [w]x)`.

    Attributes:
        current: Its current matrix R0, local to world.
        small: Its unknown small rotation w.
    """

    current: Matrix3
    small: Point3

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Three unknowns and nine context values (a label each), `WORLD_TO_LOCAL` if transposed."""
        small, matrix, *mark = labels
        transposed = mark == [WORLD_TO_LOCAL]
        names = component_names((small,), "xyz"), matrix_names(matrix)
        meaning = "current matrix, row by row" + (", transposed" if transposed else "")
        atom = Atom("Rotation", *names, "rotation", transposed, "rad", meaning)

        def build(scalars: Sequence[Scalar], context: Sequence[Scalar]) -> Rotation:
            stored = Matrix3.from_scalars(context)
            return cls(stored.T if transposed else stored, Point3(*scalars))

        return Declaration((atom,), build)

    def __matmul__(self, vector: Point3) -> Point3:
        return self.current @ (vector - self.small.cross(vector))

    def inverse(self) -> "InverseRotation":
        """From the world to the local frame."""
        return InverseRotation(self)

    def matrix(self) -> Matrix3:
        """The matrix R0 (I - [w]x): row r of R0 becomes r + w ^ r."""
        a, b, c = (row + self.small.cross(row) for row in self.current.rows)
        return Matrix3((a, b, c))


@dataclass(frozen=True)
class InverseRotation:
    """The inverse of a rotation, taken as its transpose `(I + [w]x) R0^T`."""

    rotation: Rotation

    @overload
    def __matmul__(self, other: Point3) -> Point3: ...

    @overload
    def __matmul__(self, other: Rotation) -> Matrix3: ...

    def __matmul__(self, other: Point3 | Rotation) -> Point3 | Matrix3:
        """A vector in the local frame; or the matrix of another rotation relative to this one."""
        if isinstance(other, Rotation):
            current = self.rotation.current.T @ other.current
            return Matrix3.from_columns(*map(self._turn, Rotation(current, other.small).matrix().columns()))
        return self._turn(self.rotation.current.T @ other)

    def _turn(self, vector: Point3) -> Point3:
        return vector + self.rotation.small.cross(vector)

    def matrix(self) -> Matrix3:
        """The matrix (I + [w]x) R0^T."""
        return self.rotation.matrix().T


@dataclass(frozen=True)
class Pose:
    """A local frame in the world: its centre and the rotation from local to world."""

    centre: Point3
    rotation: Rotation

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Six unknowns (labels of centre, small rotation) and nine context values (label of matrix)."""
        centre, *rotation = labels
        (turning,) = (declared := Rotation.declare(rotation, formula)).atoms
        atoms = (Atom("Point3", component_names((centre,), "xyz"), part="centre", unit="m"), turning)

        def build(scalars: Sequence[Scalar], context: Sequence[Scalar]) -> Pose:
            return cls(Point3(*scalars[:3]), declared.build(scalars[3:], context))

        return Declaration(atoms, build)

    def __matmul__(self, point: Point3) -> Point3:
        return self.centre + self.rotation @ point

    def inverse(self) -> "InversePose":
        """From the world to the local frame."""
        return InversePose(self)


@dataclass(frozen=True)
class InversePose:
    """The inverse of a pose: world points to local coordinates."""

    pose: Pose

    def __matmul__(self, point: Point3) -> Point3:
        return self.pose.rotation.inverse() @ (point - self.pose.centre)


class Direction(Point3):
    """A unit vector `N0 + du U + dv V`: its unknowns are the two tangent components, 0 in an adjustment.

    The argument of the formula is the vector itself, a `Point3`.
    """

    @classmethod
    def declare(cls, labels: Sequence[str], formula: object) -> Declaration:
        """Two unknowns (first label); nine context values `PNorm`, `DirU`, `DirV` (second: suffix)."""
        tangent, suffix = labels
        context = tuple(
            name
            for prefix in ("PNorm", "DirU", "DirV")
            for name in component_names((prefix + suffix,), "xyz")
        )

        def build(scalars: Sequence[Scalar], context: Sequence[Scalar]) -> Direction:
            normal, along_u, along_v = (Point3(*context[k : k + 3]) for k in (0, 3, 6))
            moved: Point3 = normal + scalars[0] * along_u + scalars[1] * along_v
            return cls(moved.x, moved.y, moved.z)

        meaning = "current vector and its two tangents"
        atom = Atom("Direction", component_names((tangent,), "xy"), context, meaning=meaning)
        return Declaration((atom,), build)

"""Vectors (3,) as tuples, matrices (3, 3) as tuples of rows: compiled maths without allocation."""

import math

import numpy as np

from uam_control.maths.compiled import borrowing

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]  # of a matrix


@borrowing
def vector(values: np.ndarray) -> Vector:
    """Return an array (3,) as a vector."""
    return values[0], values[1], values[2]


@borrowing
def write(a: Vector, into: np.ndarray) -> None:
    """Write a to an array (3,)."""
    into[0], into[1], into[2] = a


@borrowing
def rows(values: np.ndarray) -> Rows:
    """Return an array (3, 3) as rows."""
    return vector(values[0]), vector(values[1]), vector(values[2])


@borrowing
def plus(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@borrowing
def minus(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@borrowing
def times(factor: float, a: Vector) -> Vector:
    """Return factor a."""
    return factor * a[0], factor * a[1], factor * a[2]


@borrowing
def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@borrowing
def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@borrowing
def turned(matrix: Rows, a: Vector) -> Vector:
    """Return the matrix times a."""
    return dot(matrix[0], a), dot(matrix[1], a), dot(matrix[2], a)


@borrowing
def transposed(matrix: Rows) -> Rows:
    """Return the transpose: of a rotation, its inverse."""
    a, b, c = matrix
    return (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])


@borrowing
def product(a: Rows, b: Rows) -> Rows:
    """Return the matrix a b."""
    columns = transposed(b)
    return turned(columns, a[0]), turned(columns, a[1]), turned(columns, a[2])


@borrowing
def about(axis: Vector, angle: float) -> Rows:
    """Return the rotation about a unit axis by an angle [rad] (Rodrigues)."""
    x, y, z = axis
    c, s = math.cos(angle), math.sin(angle)
    d = 1.0 - c
    return (
        (c + d * x * x, d * x * y - s * z, d * x * z + s * y),
        (d * x * y + s * z, c + d * y * y, d * y * z - s * x),
        (d * x * z - s * y, d * y * z + s * x, c + d * z * z),
    )

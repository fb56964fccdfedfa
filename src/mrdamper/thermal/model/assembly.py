"""Sums of sparse matrices that share one pattern, factorised again and again in one order of elimination.

Where the entries of each term go is worked out once. A sum is then a few products of vectors, and it stands
already in the order in which it is eliminated; SciPy's own sums and permutations take longer than the
factorisation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from mrdamper.arrays import FloatArray
from mrdamper.thermal.model.mesh import IntArray
from mrdamper.thermal.model.stepping import Solver

if TYPE_CHECKING:
    from scipy.sparse.linalg import SuperLU

Sparse = Any  # a sparse matrix


class Assembly:
    r"""Matrices :math:`\sum_k f_k A_k + S^T \mathrm{diag}(w) S` and their solvers.

    Parameters
    ----------
    patterns : between them all entries of the terms A, shape (n, n) each
    surface : S, shape (p, n)
    """

    def __init__(self, patterns: Sequence[Sparse], surface: Sparse) -> None:
        self._size = size = surface.shape[1]
        pairs, point, products = _pairs(sparse.csr_array(surface))
        places = [pairs, *(sparse.coo_array(each).coords for each in patterns)]
        rows, columns = (np.concatenate([each[k] for each in places]) for k in (0, 1))
        whole = sparse.csc_array((np.ones(len(rows)), (rows, columns)), shape=(size, size))
        whole.sum_duplicates()
        self._rows, self._starts = whole.indices, whole.indptr
        self._columns = np.repeat(np.arange(size), np.diff(self._starts))
        self._sorted = self._columns * size + self._rows  # where an entry stands, in the drawing's order
        self._place = np.arange(len(self._sorted))  # of each of them in the sum
        shape = (len(self._sorted), surface.shape[0])
        self._film = sparse.csr_array((products, (self._places_of(*pairs), point)), shape=shape)
        self._order: IntArray | None = None
        self._placed: dict[int, tuple[Sparse, FloatArray]] = {}

    def _arrange(self, order: IntArray) -> None:
        """Let the rows and columns of sums stand in an order, from now on."""
        rank = np.argsort(order)
        rows, columns = rank[self._rows], rank[self._columns]
        moved = np.argsort(columns * self._size + rows)
        self._order, self._rows, self._columns = order, rows[moved].astype(np.intc), columns[moved]
        self._starts = np.searchsorted(self._columns, np.arange(self._size + 1)).astype(np.intc)
        self._place = np.argsort(moved)
        self._film = self._film[moved]
        self._placed = {key: (each, entries[moved]) for key, (each, entries) in self._placed.items()}

    def _places_of(self, rows: NDArray[np.integer], columns: NDArray[np.integer]) -> IntArray:
        """Return the places of entries in the sum."""
        keys = columns.astype(np.int64) * self._size + rows
        return np.asarray(self._place[np.searchsorted(self._sorted, keys)])

    def _entries(self, matrix: Sparse) -> FloatArray:
        """Return the entries of a term at the places of the sum."""
        kept = self._placed.get(id(matrix))
        if kept is not None and kept[0] is matrix:
            return kept[1]
        found = sparse.csr_array(matrix)
        found.sum_duplicates()
        entries = np.zeros(len(self._sorted))
        rows = np.repeat(np.arange(self._size), np.diff(found.indptr))
        entries[self._places_of(rows, found.indices)] = found.data
        self._placed[id(matrix)] = matrix, entries
        return entries

    def solver(self, terms: Sequence[tuple[Sparse, float]], weight: FloatArray) -> Solver:
        """Return the solver of a sum of terms, each with its factor, and of S by its weights, shape (p,)."""
        entries: FloatArray = np.asarray(self._film @ weight)
        for matrix, factor in terms:
            entries += factor * self._entries(matrix)
        whole = sparse.csc_array((entries, self._rows, self._starts), shape=(self._size, self._size))
        whole.has_canonical_format = True
        if self._order is None:
            factors = _factors(whole, "MMD_AT_PLUS_A")
            self._arrange(np.argsort(factors.perm_c))
            return lambda right: np.asarray(factors.solve(right))
        order, factors = self._order, _factors(whole, "NATURAL")

        def solve(right: FloatArray) -> FloatArray:
            found = np.empty_like(right)
            found[order] = factors.solve(right[order])
            return found

        return solve


def factorise(matrix: Sparse) -> Solver:
    """Return the solver of a sparse, nearly symmetric matrix."""
    factors = _factors(sparse.csc_array(matrix), "MMD_AT_PLUS_A")
    return lambda right: np.asarray(factors.solve(right))


def _pairs(surface: Sparse) -> tuple[tuple[IntArray, IntArray], IntArray, FloatArray]:
    """Return rows and columns of all products of two entries of a point, the point, and the product."""
    counts = np.diff(surface.indptr)
    point = np.repeat(np.arange(len(counts)), counts)
    left = np.repeat(np.arange(len(point)), counts[point])
    first = np.cumsum(counts[point]) - counts[point]
    right = surface.indptr[point[left]] + np.arange(len(left)) - first[left]
    places = surface.indices[left], surface.indices[right]
    return places, point[left], surface.data[left] * surface.data[right]


def _factors(matrix: Sparse, order: Literal["MMD_AT_PLUS_A", "NATURAL"]) -> SuperLU:
    """Return SuperLU's factors; wide panels and relaxed supernodes, its defaults, pay for denser ones."""
    from scipy.sparse.linalg import splu

    return splu(
        matrix,
        permc_spec=order,
        diag_pivot_thresh=0.01,
        relax=1,
        panel_size=2,
        options={"SymmetricMode": True},
    )

"""Solvers that share no code with ours or with each other, behind one signature: a QP in, a point or None out."""

import multiprocessing
from collections.abc import Callable
from multiprocessing.connection import Connection

import daqp
import numpy as np
import quadprog
from scipy.linalg import qr

from kinqp.solvers import QP

Reference = Callable[[QP], np.ndarray | None]


def by_daqp(qp: QP) -> np.ndarray | None:
    sense = np.where(qp.lower == qp.upper, 5, 0).astype(np.intc)
    limit = np.clip([qp.lower, qp.upper], -1e30, 1e30)
    x, _, flag, _ = daqp.solve(qp.H.copy(), qp.g.copy(), qp.stacked.copy(), limit[1], limit[0], sense)
    return np.array(x) if flag in (1, 2) else None


def by_quadprog(qp: QP) -> np.ndarray | None:
    """Answer strictly convex problems; dependent equalities are left out, since quadprog calls them inconsistent."""
    fixed = np.flatnonzero(qp.lower == qp.upper)
    if len(fixed):
        _, triangle, order = qr(qp.stacked[fixed].T, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(triangle))
        fixed = np.sort(fixed[order[: int((diagonal > 1e-10 * max(diagonal[0], 1e-300)).sum())]])
    rows, sides = [qp.stacked[fixed]], [qp.lower[fixed]]
    for sign, bound in ((1.0, qp.lower), (-1.0, qp.upper)):
        kept = np.flatnonzero(np.isfinite(bound) & (qp.lower != qp.upper) & qp.stacked.any(axis=1))
        rows.append(sign * qp.stacked[kept])
        sides.append(sign * bound[kept])
    G = np.vstack(rows).T.copy()
    # quadprog copies nothing and takes no empty arrays.
    constraints = (G, np.concatenate(sides), len(fixed)) if G.size else ()
    try:
        return np.asarray(quadprog.solve_qp(qp.H.copy(), -qp.g, *constraints)[0])
    except ValueError:
        return None


class Guarded:
    """A reference that may loop for ever, in a child process that is replaced when it does not answer in time."""

    def __init__(self, reference: Reference, seconds: float = 2.0) -> None:
        self.reference = reference
        self.seconds = seconds
        self.hangs = 0
        # Not forked: a child must not inherit the threads of the libraries that the tests load.
        self._context = multiprocessing.get_context("spawn")
        self._start()

    def __call__(self, qp: QP) -> np.ndarray | None:
        self._pipe.send(qp)
        if self._pipe.poll(self.seconds):
            answer: np.ndarray | None = self._pipe.recv()
            return answer
        self.hangs += 1
        self.close()
        self._start()
        return None

    def close(self) -> None:
        self._child.kill()
        self._child.join()
        self._pipe.close()

    def _start(self) -> None:
        self._pipe, other = self._context.Pipe()
        self._child = self._context.Process(target=_serve, args=(self.reference, other), daemon=True)
        self._child.start()
        other.close()
        # The first answer waits for the child's imports.
        self._pipe.send(QP(H=np.eye(1), g=[1.0]))
        self._pipe.recv()


def _serve(reference: Reference, pipe: Connection) -> None:
    try:
        while True:
            pipe.send(reference(pipe.recv()))
    except EOFError:
        pass

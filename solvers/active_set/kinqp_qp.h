/* The canonical QP by reduction to least distance:
 *
 *   minimise 1/2 x'Hx + g'x  subject to  A x = b,  l <= C x <= u,  lb <= x <= ub      (infinite = absent)
 *
 * Duals: H x + g + A'y + C'z + z_box = 0; negative z: the lower side is active. Matrices are row-major.
 * H must be symmetric and positive semidefinite; it may be singular or zero.
 */
#ifndef KINQP_QP_H
#define KINQP_QP_H

#include <stddef.h>

#include "kinqp_status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int n;            /* variables [count] */
    int p;            /* rows of A [count] */
    int m;            /* rows of C [count] */
    const double *H;  /* Hessian (n, n) [cost / x^2] */
    const double *g;  /* linear cost (n,) [cost / x] */
    const double *A;  /* equality rows (p, n) [row unit / x]; NULL if p = 0 */
    const double *b;  /* right-hand sides (p,) [row unit]; NULL if p = 0 */
    const double *C;  /* two-sided rows (m, n) [row unit / x]; NULL if m = 0 */
    const double *l;  /* lower bounds of C x (m,) [row unit]; NULL: none */
    const double *u;  /* upper bounds of C x (m,) [row unit]; NULL: none */
    const double *lb; /* lower bounds of x (n,) [x]; NULL: none */
    const double *ub; /* upper bounds of x (n,) [x]; NULL: none */
} kinqp_qp;

typedef struct {
    double tolerance;   /* relative KKT residual up to which an answer counts as SOLVED [-] */
    int max_iterations; /* cap on active-set steps over all passes [count] */
    int max_passes;     /* cap on outer passes; one suffices if H is positive definite [count] */
    int warm;           /* 1: start from the signs in solution.active [flag] */
} kinqp_qp_options;

typedef struct {
    double *x;       /* out (n,): solution; the direction if DUAL_INFEASIBLE [x] */
    double *y;       /* out (p,): duals of A x = b; certificate if PRIMAL_INFEASIBLE [cost / row unit] */
    double *z;       /* out (m,): duals of l <= C x <= u; certificate if PRIMAL_INFEASIBLE [cost / row unit] */
    double *z_box;   /* out (n,): duals of the box; certificate if PRIMAL_INFEASIBLE [cost / x] */
    int *active;     /* out (m + n,): -1, 0, +1 for the rows of C, then the box; in if warm [sign] */
    int iterations;  /* out: active-set steps over all passes [count] */
    int passes;      /* out: outer passes [count] */
    double primal;   /* out: largest violation of a row, relative to its bound or its terms, whichever is more, but to no
                      * less than the row at a ten-thousandth of a unit of x or, where data contradict themselves by
                      * noise, at four units; infinite: rows contradict each other, but not provably [-] */
    double dual;         /* out: largest stationarity residual in scaled variables, relative to the largest terms; or,
                          * where worse, 2e-3 of it as given, relative to the largest of |H|, |Hx|, |g|, |A'y..| [-] */
    double gap;      /* out: largest complementarity product, relative to the largest term of the objective [-] */
} kinqp_qp_solution;

/* Defaults: tolerance 1e-9, max_iterations 50 (m + n) + 200, max_passes 60, cold. */
kinqp_qp_options kinqp_qp_default_options(int n, int p, int m);

/* Bytes of workspace for these sizes; 0 if a size is negative. */
size_t kinqp_qp_workspace_size(int n, int p, int m);

/* Solves. `memory`: aligned for double, kinqp_qp_workspace_size bytes. On FAILED the solution's arrays are zero. */
kinqp_status kinqp_qp_solve(const kinqp_qp *qp, const kinqp_qp_options *options, void *memory,
                            kinqp_qp_solution *solution);

/* Fills solution->primal, dual and gap from x, y, z, z_box and the data alone, small rows at four units of x. scale: unit
 * of each variable (n,), NULL: all 1; kinqp_qp_solve uses 1 / sqrt(H_jj), or where H_jj is 0 one over the column's largest
 * entry once rows are brought to one size. */
void kinqp_qp_residuals(const kinqp_qp *qp, const double *scale, kinqp_qp_solution *solution);

/* 1 if y, z, z_box prove that no point is feasible: A'y + C'z + z_box = 0 with a support value that is negative by more
 * than what the bounds may be off by: 1e-9 of each, or 4e-9 times its row's entries. */
int kinqp_qp_proves_infeasible(const kinqp_qp *qp, const kinqp_qp_solution *solution);

/* 1 if the direction proves that the cost is unbounded below: H d = 0, g'd < 0, and d leaves no row. */
int kinqp_qp_proves_unbounded(const kinqp_qp *qp, const double *direction);

#ifdef __cplusplus
}
#endif
#endif

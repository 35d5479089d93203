/* Least distance: minimise 1/2 |w|^2 subject to lo <= M w <= hi, by a dual active set.
 *
 * Duals: w + M'z = 0; z > 0: upper side active, z < 0: lower side active.
 * Infinite bounds are absent. M is row-major (m, n). Entries of M should lie within 1e-150 .. 1e150.
 * M is not read when w = 0 is admissible.
 *
 * Run-time sizes: kinqp_as_workspace_size + kinqp_as_setup, then kinqp_as_solve (this header, kinqp_as.c).
 * Sizes known at compile time: see kinqp_as_fixed.h.
 */
#ifndef KINQP_AS_H
#define KINQP_AS_H

#include <stddef.h>

#include "kinqp_status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    double violation;    /* a row is violated if farther [unit of w] than this times max(|w|, scale) [-] */
    double dependence;   /* a row is dependent if less than this share of it is outside the active normals [-] */
    double inconsistent; /* a dependent row violated by less than this times max(|w|, scale) counts as satisfied, else
                          * infeasible; a row of zeros by less than this itself [-] */
    double scale;        /* length that the data's own rounding is relative to, e.g. |v| [unit of w] */
    int max_iterations;  /* cap on steps, each adding or dropping one row [count] */
    int warm;            /* 1: start from the signs in `active`; 0: cold [flag] */
    int polish;          /* recompute w and z once from the final active set: 0 never, 1 always, 2 if a row was dropped on
                          * the way, since near-dependent rows leave their rounding in w as they pass through [choice] */
} kinqp_as_options;

typedef struct {
    int iterations;      /* steps taken, each adding or dropping one row [count] */
    int row;             /* infeasible or failed: the row that showed it; else -1 [index] */
    double scaling;      /* share kept of the way from the admissible point to the iterate; 1: not scaled [-] */
} kinqp_as_result;

/* Why indices stay inside: at most n rows are active at once, since a row enters only if it is independent of those that
 * are, and the loops over rows end at m. Where k is compared with n (append, drop, enter) it says more. */
typedef struct {
    int n;               /* columns of M [count] */
    int m;               /* rows of M [count] */
    int k;               /* active rows [count] */
    double *q;           /* orthonormal basis of the active normals, column j at q + j n; (n, n) [-] */
    double *r;           /* upper triangle, signed active normals = Q R, column j at r + j n; (n, n) [unit of M] */
    double *rinv;        /* reciprocals of R's diagonal (n,) [1 / unit of M] */
    double *u;           /* multipliers of the signed active rows, >= 0 (n,) [unit of z] */
    double *d;           /* entering normal in the basis Q (n,) [unit of M] */
    double *p;           /* signed entering normal (n,) [unit of M] */
    double *e;           /* entering normal outside the basis (n,) [unit of M] */
    double *t;           /* change of the multipliers per unit of the entering one (n,) [-] */
    double *norm2;       /* squared norms of the rows (m,) [unit of M squared] */
    double *weight;      /* 1 / norm2, or 0 while the row may not enter (m,) */
    double *gap;         /* how far each row is outside; negative: inside (m,) [unit of M w] */
    int *rows;           /* active rows in the order of Q's columns (n,) [index] */
    int *signs;          /* -1: lower side, +1: upper side, per active row (n,) */
    const double *slack; /* NULL, or how far a row may be outside before it enters (m,) [unit of M w] */
    const double *noise; /* NULL, or how far each bound may be off: what contradicts others by less than their sum counts as
                          * satisfied; instead of `inconsistent` (m,) [unit of M w] */
    const double *offset; /* NULL, or multipliers z0 that the target already accounts for, as target + M'z0 is meant; then
                           * a large target that active rows hold leaves no rounding. Needs `warm` (m,) [unit of z] */
} kinqp_as_state;

/* Defaults: cold, polished, max_iterations = 10 (m + n) + 50. */
kinqp_as_options kinqp_as_default_options(int n, int m);

/* Bytes that kinqp_as_setup needs for m rows and n columns; 0 if a size is negative. */
size_t kinqp_as_workspace_size(int n, int m);

/* Lays the state out in `memory` (aligned for double, kinqp_as_workspace_size bytes); slack, noise and offset are NULL. */
void kinqp_as_setup(kinqp_as_state *state, int n, int m, void *memory);

/* Solves. target: NULL, or the point t (n,) to stay near: then 1/2 |w - t|^2 is minimised and w - t + M'z = 0.
 * w: out (n,). z: out (m,), on PRIMAL_INFEASIBLE the certificate (M'z = 0, hi'z+ + lo'z- < 0).
 * active: out (m,) in -1, 0, +1; in when options->warm.
 * admissible: NULL (fast), or a point (n,) that satisfies all rows (feasible): then a stop at the cap returns a point
 * on the segment from it to the iterate which satisfies all rows too, within options->violation. */
kinqp_status kinqp_as_solve(kinqp_as_state *state, const double *matrix, const double *lo, const double *hi,
                            const double *target, const double *admissible, const kinqp_as_options *options, double *w,
                            double *z, int *active, kinqp_as_result *result);

/* As kinqp_as_solve with target NULL, by a primal active set: from `admissible` (required) on, every iterate satisfies
 * all rows. Slower and less exact at a cap than kinqp_as_solve with an admissible point; kept for comparison. */
kinqp_status kinqp_as_primal(kinqp_as_state *state, const double *matrix, const double *lo, const double *hi,
                             const double *admissible, const kinqp_as_options *options, double *w, double *z,
                             int *active, kinqp_as_result *result);

#ifdef __cplusplus
}
#endif
#endif

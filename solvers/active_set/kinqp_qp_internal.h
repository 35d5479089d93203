/* Shared by the front end's own files; not part of the interface. */
#ifndef KINQP_QP_INTERNAL_H
#define KINQP_QP_INTERNAL_H

#include "kinqp_as.h"
#include "kinqp_qp.h"

/* Data carry rounding of what they were computed from, which may be much larger than what is left of it: a bound counts
 * as known to KINQP_QP_RELATIVE of itself and of the row's terms, or to KINQP_QP_NOISE of the row's entries (that is, x
 * to so much of its unit), whichever is more. What contradicts other rows by no more than that is not infeasible. */
#define KINQP_QP_RELATIVE 1e-9
#define KINQP_QP_NOISE 4e-9
#define KINQP_QP_UNITS (KINQP_QP_NOISE / KINQP_QP_RELATIVE)
#define KINQP_QP_ROUNDING 1e-4 /* units of x times the tolerance that are rounding, where no noise has to be allowed [-] */

/* Why indices stay inside: equalities + rows <= limit = p + m + n, as kinqp_qp_scale makes at most one of each row of A,
 * row of C and variable, rows only of the latter two; rank <= min(n, equalities), so free = n - rank is in 0..n; the
 * core's active rows are at most free. eid, id, pivot and kpivot hold indices that these loops have written. */
typedef struct {
    int n;            /* variables [count] */
    int free;         /* dimension left by the equalities [count] */
    int equalities;   /* rows in E: A, then rows with equal bounds [count] */
    int rank;         /* independent equalities [count] */
    int rows;         /* two-sided rows handed to the core [count] */
    int limit;        /* p + m + n: equalities and rows together, each of which is one or the other or absent [count] */
    int costless;     /* 1: H and g are zero, so all duals are [flag] */
    double *scale;    /* x = scale * scaled x, powers of two (n,) */
    double *cscale;   /* factors of C's rows, powers of two (m,) */
    double *hess;     /* scaled Hessian (n, n) */
    double *g;        /* scaled linear cost (n,) */
    double *rowmat;   /* scaled rows (m, n) */
    double *eqfactor; /* scaled equality rows, then their Householder factors (p + m + n, n) */
    double *eqmat;    /* scaled equality rows as they are (p + m + n, n) */
    double *e;        /* right-hand sides of E (p + m + n,) */
    double *efactor;  /* dual of the caller's row = efactor * dual of E's row (p + m + n,) */
    double *tau;      /* Householder factors (n,) */
    double *diagonal; /* diagonal of the equalities' triangle (n,) */
    double *basis;    /* orthonormal basis of E's null space (n, free), row-major (n, n) */
    double *curv;     /* Hessian on the null space (free, free) */
    double *chol;     /* its Cholesky factor, with diagonal pivoting (free, free) */
    double *white;    /* Z P L^-T: whitened steps to scaled x (n, free) */
    double *whiterows; /* rows in whitened coordinates (rows, free) */
    double *lo;       /* bounds of M w (rows,) */
    double *hi;       /* bounds of M w (rows,) */
    double *lower;    /* bounds of the scaled rows (rows,) */
    double *upper;    /* bounds of the scaled rows (rows,) */
    double *x;        /* scaled iterate (n,) */
    double *centre;   /* whitened step to the unconstrained minimiser, the core's target (free,) */
    double *trial;    /* scaled iterate, refined on its active set (n,) */
    double *last;     /* scaled iterate of the pass before (n,) */
    double *grad;     /* gradient at an iterate (n,) */
    double *w;        /* whitened step (n,) */
    double *v;        /* scratch (n,) */
    double *s;        /* scratch (n,) */
    double *noise;    /* what the bounds of the scaled rows may be off by, where rows and bounds are small (m + n,) */
    double *enoise;   /* the same of E's rows (p + m + n,) */
    double *slack;    /* how far a row may be outside at the iterate before it enters (m + n,) */
    double *doubt;    /* what a row's bound may be off by at the iterate (m + n,) */
    double *offset;   /* duals at the iterate (m + n,) */
    double *rowz;     /* duals of the rows handed to the core (m + n,) */
    double *ey;       /* duals of E's rows (p + m + n,) */
    int *eid;         /* caller's row of each equality: A's, then C's from p, then the box from p + m (p + m + n,) */
    int *id;          /* caller's row of each row handed to the core: C's, then the box from m (m + n,) */
    int *sign;        /* active set in the core's rows (m + n,) */
    int *pivot;       /* permutation of E's rows, then of K (p + m + n,) */
    int *kpivot;      /* permutation of K's rows (n,) */
    double *core;     /* the core's own memory */
    kinqp_as_state state; /* the core's state */
} kinqp_qp_work;

/* By its bits, since compilers that are told that all numbers are finite leave comparisons out: 1 for NaN. */
static inline int kinqp_qp_is_nan(double value) {
    union { double number; unsigned long long bits; } as;
    as.number = value;
    return (as.bits & 0x7fffffffffffffffULL) > 0x7ff0000000000000ULL;
}

/* By its bits: 0 for NaN and for the infinities. */
static inline int kinqp_qp_is_finite(double value) {
    union { double number; unsigned long long bits; } as;
    as.number = value;
    return (as.bits & 0x7ff0000000000000ULL) != 0x7ff0000000000000ULL;
}

/* 1 if a lower bound is above its upper bound by more than noise. entries: sum of the row's absolute entries. */
int kinqp_qp_crossed(double l, double u, double entries);

/* As kinqp_qp_residuals; a row and the gradient count at least as at `least` units of x. */
void kinqp_qp_measure(const kinqp_qp *qp, const double *scale, double least, kinqp_qp_solution *s);

/* Powers of two near 1 / value; 1 for zero. */
double kinqp_qp_power(double value);

double kinqp_qp_dot(const double *a, const double *b, int n);

/* Sum of the absolute entries. */
double kinqp_qp_entries(const double *row, int n);

/* Householder factorisation of E's rows with row pivoting: fills rank, tau, diagonal, pivot. */
void kinqp_qp_factor_equalities(kinqp_qp_work *k);

/* v := Q'v or Q v, with Q from the equalities' factorisation. */
void kinqp_qp_apply_transposed(const kinqp_qp_work *k, double *v);
void kinqp_qp_apply(const kinqp_qp_work *k, double *v);

/* ey := least-squares duals with E'ey = v (v is overwritten). */
void kinqp_qp_equality_duals(const kinqp_qp_work *k, double *v, double *ey);

/* x += the shortest step onto E x = e, as a correction of what E x misses. */
void kinqp_qp_restore_equalities(const kinqp_qp_work *k, double *x);

/* L from K + shift I with diagonal pivoting; returns the smallest pivot relative to the largest
 * diagonal (shift 0: of the whole Hessian); negative if K is not semidefinite. */
double kinqp_qp_cholesky(kinqp_qp_work *k, double shift);

/* T from Z and L; M from T and the rows. */
void kinqp_qp_whiten(kinqp_qp_work *k, int m);

/* Scaled copies, equality rows, row list. FAILED: not finite or not symmetric. */
kinqp_status kinqp_qp_scale(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s);

/* Eliminates the equalities: Z, K, x on E x = e, rows that they fix removed. Infeasible: certificate in s. */
kinqp_status kinqp_qp_reduce(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s);

/* Writes x and duals of the scaled problem to the caller's arrays; y from stationarity (certificate: of cost 0). */
void kinqp_qp_recover(kinqp_qp_work *k, const kinqp_qp *qp, const double *x, int certificate, kinqp_qp_solution *s);

/* The curvature that proximal weights are relative to: H's, or for a linear cost one that makes steps of data size. */
double kinqp_qp_curvature(const kinqp_qp_work *k);

/* Outer passes on the reduced problem. shift: proximal weight that white was made with, 0 where H needs none. */
kinqp_status kinqp_qp_passes(kinqp_qp_work *k, const kinqp_qp *qp, const kinqp_qp_options *o, double shift,
                             kinqp_qp_solution *s);

#endif

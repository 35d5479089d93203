/* Shared by the front end's own files; not part of the interface. */
#ifndef KINQP_QP_INTERNAL_H
#define KINQP_QP_INTERNAL_H

#include "kinqp_as.h"
#include "kinqp_qp.h"

typedef struct {
    int n;            /* variables [count] */
    int free;         /* dimension left by the equalities [count] */
    int equalities;   /* rows in E: A, then rows with equal bounds [count] */
    int rank;         /* independent equalities [count] */
    int rows;         /* two-sided rows handed to the core [count] */
    int costless;     /* 1: H and g are zero, so all duals are [flag] */
    double *scale;    /* x = scale * scaled x, powers of two (n,) */
    double *cscale;   /* factors of C's rows, powers of two (m,) */
    double *H;        /* scaled Hessian (n, n) */
    double *g;        /* scaled linear cost (n,) */
    double *C;        /* scaled rows (m, n) */
    double *E;        /* scaled equality rows, then their Householder factors (p + m + n, n) */
    double *E0;       /* scaled equality rows as they are (p + m + n, n) */
    double *e;        /* right-hand sides of E (p + m + n,) */
    double *efactor;  /* dual of the caller's row = efactor * dual of E's row (p + m + n,) */
    double *tau;      /* Householder factors (n,) */
    double *diagonal; /* diagonal of the equalities' triangle (n,) */
    double *Z;        /* orthonormal basis of E's null space (n, free), row-major (n, n) */
    double *K;        /* Hessian on the null space (free, free) */
    double *L;        /* its Cholesky factor, with diagonal pivoting (free, free) */
    double *T;        /* Z P L^-T: whitened steps to scaled x (n, free) */
    double *M;        /* rows in whitened coordinates (rows, free) */
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

/* Powers of two near 1 / value; 1 for zero. */
double kinqp_qp_power(double value);

double kinqp_qp_dot(const double *a, const double *b, int n);

/* Householder factorisation of E's rows with row pivoting: fills rank, tau, diagonal, pivot. */
void kinqp_qp_factor_equalities(kinqp_qp_work *k);

/* v := Q'v or Q v, with Q from the equalities' factorisation. */
void kinqp_qp_apply_transposed(const kinqp_qp_work *k, double *v);
void kinqp_qp_apply(const kinqp_qp_work *k, double *v);

/* ey := least-squares duals with E'ey = v (v is overwritten). */
void kinqp_qp_equality_duals(const kinqp_qp_work *k, double *v, double *ey);

/* x += the shortest step onto E x = e. */
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

#endif

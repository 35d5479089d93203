/* From the caller's QP to the scaled one: checks, units of the variables, rows by kind. */
#include <math.h>

#include "kinqp_qp_internal.h"

#define KINQP_SWEEPS 3            /* sweeps over rows and columns for the units of variables without curvature [count] */
#define KINQP_NO_CURVATURE 1e-10 /* a root of curvature below this, beside the largest, is none [-] */

static int finite_all(const double *a, int count) {
    int ok = 1;
    for (int i = 0; i < count; ++i) ok &= kinqp_qp_is_finite(a[i]);
    return ok;
}

/* 0: fine; 1: bounds that cross by more than noise; 2: not a pair of bounds. rows: NULL for a box. */
static int check_bounds(const double *rows, const double *l, const double *u, int count, int n) {
    int crossed = 0;
    for (int i = 0; i < count; ++i) {
        const double low = l ? l[i] : -HUGE_VAL, high = u ? u[i] : HUGE_VAL;
        if (kinqp_qp_is_nan(low) || (low > 0.0 && !kinqp_qp_is_finite(low))) return 2;
        if (kinqp_qp_is_nan(high) || (high < 0.0 && !kinqp_qp_is_finite(high))) return 2;
        if (low > high) crossed |= kinqp_qp_crossed(low, high, rows ? kinqp_qp_entries(rows + i * n, n) : 1.0);
    }
    return crossed;
}

/* factors[i]: 1 / the largest entry of a row, its variables in their units so far; A's rows, then C's. */
static void level_rows(const kinqp_qp_work *k, const kinqp_qp *qp, double *factors) {
    for (int i = 0; i < qp->p + qp->m; ++i) {
        const double *row = i < qp->p ? qp->A + i * k->n : qp->C + (i - qp->p) * k->n;
        double largest = 0.0;
        for (int j = 0; j < k->n; ++j) largest = fmax(largest, fabs(row[j]) * k->scale[j]);
        factors[i] = largest > 0.0 && kinqp_qp_is_finite(1.0 / largest) ? 1.0 / largest : 0.0;
    }
}

/* out[j]: largest entry of column j, the rows multiplied by their factors. */
static void column_sizes(const kinqp_qp_work *k, const kinqp_qp *qp, const double *factors, double *out) {
    for (int j = 0; j < k->n; ++j) out[j] = 0.0;
    for (int i = 0; i < qp->p + qp->m; ++i) {
        const double *row = i < qp->p ? qp->A + i * k->n : qp->C + (i - qp->p) * k->n;
        for (int j = 0; j < k->n; ++j) out[j] = fmax(out[j], fabs(row[j]) * factors[i]);
    }
}

/* Scales of the variables: unit Hessian diagonal; unit columns of the rows where that is zero, or so small beside the
 * others', both as it stands and measured by these columns, that it says nothing of the variable's unit. The rows are
 * brought to one size for that, so that the unit in which a row is written does not matter. */
static void scale_variables(kinqp_qp_work *k, const kinqp_qp *qp) {
    double largest = 0.0, steepest = 0.0;
    double *root = k->v, *column = k->s, *factors = k->efactor; /* n, n and p + m + n: enough for p + m rows */
    int flat = 0;
    for (int j = 0; j < k->n; ++j) {
        root[j] = sqrt(fmax(qp->H[j * k->n + j], 0.0));
        largest = fmax(largest, root[j]);
    }
    for (int j = 0; j < k->n; ++j) flat |= !(root[j] > KINQP_NO_CURVATURE * largest);
    for (int j = 0; j < k->n; ++j) k->scale[j] = kinqp_qp_power(root[j]);
    if (!flat) return;
    for (int j = 0; j < k->n; ++j)
        if (!(root[j] > KINQP_NO_CURVATURE * largest)) k->scale[j] = 1.0;
    for (int sweep = 0; sweep < KINQP_SWEEPS; ++sweep) {
        level_rows(k, qp, factors);
        column_sizes(k, qp, factors, column);
        steepest = 0.0;
        for (int j = 0; j < k->n; ++j)
            if (column[j] > 0.0) steepest = fmax(steepest, root[j] / column[j]);
        for (int j = 0; j < k->n; ++j) {
            const int curved = root[j] > KINQP_NO_CURVATURE * largest ||
                               root[j] > KINQP_NO_CURVATURE * steepest * column[j];
            k->scale[j] = kinqp_qp_power(curved || column[j] == 0.0 ? root[j] : column[j]);
        }
    }
}

/* out := row of the caller in scaled variables, brought near unit length; returns the factor. */
static double scale_row(const kinqp_qp_work *k, const double *row, double *out) {
    for (int j = 0; j < k->n; ++j) out[j] = row[j] * k->scale[j];
    const double factor = kinqp_qp_power(sqrt(kinqp_qp_dot(out, out, k->n)));
    for (int j = 0; j < k->n; ++j) out[j] *= factor;
    return factor;
}

/* There are at most p + m + n equalities: each of A's p rows, of C's m rows and of the n variables makes one at most, and
 * likewise at most m + n other rows. */
static double *new_equality(kinqp_qp_work *k, int id, double value, double factor, double noise) {
    const int i = k->equalities++;
    KINQP_ASSERT(i < k->limit);
    k->enoise[i] = KINQP_QP_NOISE * factor * noise;
    k->eid[i] = id;
    k->e[i] = value;
    k->efactor[i] = factor;
    return k->eqfactor + i * k->n;
}

static void new_row(kinqp_qp_work *k, int id, double low, double high, double noise) {
    const int i = k->rows++;
    KINQP_ASSERT(i < k->limit);
    k->noise[i] = KINQP_QP_NOISE * noise;
    k->sign[i] = 0;
    k->id[i] = id;
    k->lower[i] = low;
    k->upper[i] = high;
}

/* What the noise of a row is relative to; a row of zeros, whose unit nothing tells, counts absolutely. */
static double span(const double *row, int n) {
    const double entries = kinqp_qp_entries(row, n);
    return entries > 0.0 ? entries : 1.0;
}

static double middle(double low, double high) { return low == high ? low : 0.5 * low + 0.5 * high; }

kinqp_status kinqp_qp_scale(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    const int n = qp->n, p = qp->p, m = qp->m;
    int ok = finite_all(qp->H, n * n) & finite_all(qp->g, n) & finite_all(qp->A, p * n) & finite_all(qp->b, p) &
             finite_all(qp->C, m * n);
    const int rows = check_bounds(qp->C, qp->l, qp->u, m, n);
    const int box = check_bounds(NULL, qp->lb, qp->ub, n, n);
    if (!ok || rows == 2 || box == 2) return KINQP_FAILED;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < i; ++j) {
            const double a = qp->H[i * n + j], b = qp->H[j * n + i];
            ok &= fabs(a - b) <= 1e-9 * (fabs(a) + fabs(b)) + 1e-14 * sqrt(fabs(qp->H[i * n + i] * qp->H[j * n + j]));
        }
    if (!ok) return KINQP_FAILED;
    if (rows || box) return KINQP_PRIMAL_INFEASIBLE;
    scale_variables(k, qp);
    for (int i = 0; i < n; ++i) {
        k->g[i] = k->scale[i] * qp->g[i];
        for (int j = 0; j < n; ++j)
            k->hess[i * n + j] = 0.5 * (qp->H[i * n + j] + qp->H[j * n + i]) * k->scale[i] * k->scale[j];
    }
    k->costless = 1;
    for (int i = 0; i < n; ++i) k->costless &= k->g[i] == 0.0;
    for (int i = 0; i < n * n; ++i) k->costless &= k->hess[i] == 0.0;
    k->equalities = 0;
    k->rows = 0;
    for (int i = 0; i < p; ++i) {
        double *row = k->eqfactor + i * n;
        const double factor = scale_row(k, qp->A + i * n, row);
        (void)new_equality(k, i, factor * qp->b[i], factor, span(qp->A + i * n, n));
    }
    for (int i = 0; i < m; ++i) {
        const double low = qp->l ? qp->l[i] : -HUGE_VAL, high = qp->u ? qp->u[i] : HUGE_VAL;
        double *row = k->rowmat + i * n;
        const double factor = scale_row(k, qp->C + i * n, row);
        k->cscale[i] = factor;
        if (low >= high) { /* the same, or crossed by noise */
            double *copy = new_equality(k, p + i, factor * middle(low, high), factor, span(qp->C + i * n, n));
            for (int j = 0; j < n; ++j) copy[j] = row[j];
        } else if (kinqp_qp_is_finite(low) || kinqp_qp_is_finite(high)) {
            new_row(k, i, factor * low, factor * high, factor * span(qp->C + i * n, n));
        }
    }
    for (int i = 0; i < n; ++i) {
        const double low = qp->lb ? qp->lb[i] : -HUGE_VAL, high = qp->ub ? qp->ub[i] : HUGE_VAL;
        const double factor = 1.0 / k->scale[i];
        if (low >= high) {
            double *row = new_equality(k, p + m + i, factor * middle(low, high), factor, 1.0);
            for (int j = 0; j < n; ++j) row[j] = 0.0;
            row[i] = 1.0;
        } else if (kinqp_qp_is_finite(low) || kinqp_qp_is_finite(high)) {
            new_row(k, m + i, factor * low, factor * high, factor);
        }
    }
    (void)s;
    return KINQP_SOLVED;
}

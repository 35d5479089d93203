/* KKT residuals and certificates of the canonical QP, from the caller's data alone. */
#include <math.h>

#include "kinqp_qp.h"
#include "kinqp_qp_internal.h"

#define KINQP_CERTIFICATE_TOLERANCE 1e-8 /* relative residual of a certificate [-] */
#define KINQP_PROOF 0.95                 /* share of the noise in all bounds that a contradiction has to exceed [-] */
#define KINQP_NET_WEIGHT 2e-3            /* weight of the stationarity residual relative to net sums [-] */

static double lower(const double *bounds, int i) { return bounds ? bounds[i] : -HUGE_VAL; }
static double upper(const double *bounds, int i) { return bounds ? bounds[i] : HUGE_VAL; }

/* Largest of a and b; NaN in either gives infinity, so that a residual cannot hide one. */
static double worse(double a, double b) {
    if (kinqp_qp_is_nan(a) || kinqp_qp_is_nan(b)) return HUGE_VAL;
    return a > b ? a : b;
}

/* Row product; *terms gets the sum of the absolute terms, *size that of the absolute entries. */
static double product(const double *row, const double *x, int n, double *terms, double *size) {
    double sum = 0.0, most = 0.0, entries = 0.0;
    for (int j = 0; j < n; ++j) {
        const double term = row[j] * x[j];
        sum += term;
        most += fabs(term);
        entries += fabs(row[j]);
    }
    *terms = most;
    *size = entries;
    return sum;
}

/* One two-sided row: updates the worst relative violation and the complementarity product. reach: see below. */
static void row_residual(double value, double reach, double l, double u, double z, kinqp_qp_solution *s, double *size) {
    const double outside = value > u ? value - u : (value < l ? l - value : 0.0);
    if (outside > 0.0) {
        const double bound = fabs(value > u ? u : l), terms = bound > reach ? bound : reach;
        s->primal = worse(s->primal, terms > 0.0 ? outside / terms : outside);
    }
    s->primal = worse(s->primal, kinqp_qp_is_nan(value) ? HUGE_VAL : 0.0);
    if (z < 0.0 || z > 0.0) {
        const double bound = z < 0.0 ? l : u;
        s->gap = worse(s->gap, fabs(z * (value - bound)));
        *size = worse(*size, fabs(z) * reach);
        *size = worse(*size, fabs(z * bound));
    }
}

/* Largest absolute entry of a row. */
static double longest(const double *row, int n) {
    double size = 0.0;
    for (int j = 0; j < n; ++j) size = worse(size, fabs(row[j]));
    return size;
}

/* What a row's violation is relative to, its bound aside: its terms at x, and its entries times `least` units of x. A row
 * of zeros, whose unit nothing tells, counts as one whose entries sum up to 1. */
static double reach_of(double terms, double entries, double least) {
    return entries > 0.0 ? fmax(terms, least * entries) : fmax(least, 1.0);
}

void kinqp_qp_measure(const kinqp_qp *qp, const double *scale, double least, kinqp_qp_solution *s) {
    const int n = qp->n;
    double terms, entries, reach, size = 0.0, most = 0.0, largest = 0.0, rest = 0.0, net = 0.0;
    s->primal = 0.0;
    s->dual = 0.0;
    s->gap = 0.0;
    for (int i = 0; i < qp->p; ++i) {
        const double value = product(qp->A + i * n, s->x, n, &terms, &entries);
        reach = reach_of(terms, entries, least);
        row_residual(value, reach, qp->b[i], qp->b[i], 0.0, s, &size);
    }
    for (int i = 0; i < qp->m; ++i) {
        const double value = product(qp->C + i * n, s->x, n, &terms, &entries);
        reach = reach_of(terms, entries, least);
        row_residual(value, reach, lower(qp->l, i), upper(qp->u, i), s->z[i], s, &size);
    }
    for (int i = 0; i < n; ++i)
        row_residual(s->x[i], fmax(fabs(s->x[i]), least), lower(qp->lb, i), upper(qp->ub, i), s->z_box[i], s, &size);
    for (int j = 0; j < n; ++j) {
        const double unit = scale ? scale[j] : 1.0;
        const double slope = product(qp->H + j * n, s->x, n, &terms, &entries);
        double pull = s->z_box[j], part = fabs(qp->g[j]) + fabs(s->z_box[j]);
        size = worse(size, fabs(slope * s->x[j]));
        size = worse(size, fabs(qp->g[j] * s->x[j]));
        for (int i = 0; i < qp->p; ++i) {
            const double term = qp->A[i * n + j] * s->y[i];
            pull += term;
            part += fabs(term);
        }
        for (int i = 0; i < qp->m; ++i) {
            const double term = qp->C[i * n + j] * s->z[i];
            pull += term;
            part += fabs(term);
        }
        most = worse(most, unit * fabs(slope + qp->g[j] + pull));
        largest = worse(largest, unit * (fmax(terms, least * entries) + part));
        rest = worse(rest, fabs(slope + qp->g[j] + pull));
        net = worse(net, worse(fabs(slope), worse(fabs(qp->g[j]), fabs(pull))));
        net = worse(net, longest(qp->H + j * n, n));
    }
    /* Against net sums too: an x that runs away along a flat direction makes any residual small against its terms. */
    s->dual = most > 0.0 ? worse(most / largest, KINQP_NET_WEIGHT * rest / net) : most;
    s->gap = s->gap > 0.0 ? worse(0.0, s->gap / size) : s->gap;
}

void kinqp_qp_residuals(const kinqp_qp *qp, const double *scale, kinqp_qp_solution *s) {
    kinqp_qp_measure(qp, scale, KINQP_QP_UNITS, s);
}

/* Support of one row for multiplier z; 0 for z on an absent side makes the certificate void. noise: what the sum may be
 * off by since each bound may be, by KINQP_QP_RELATIVE of itself and of the row at one unit of x. */
static int support(double z, double l, double u, double entries, double *sum, double *noise) {
    const double bound = z < 0.0 ? l : u;
    if (!(z < 0.0) && !(z > 0.0)) return !kinqp_qp_is_nan(z);
    if (!kinqp_qp_is_finite(bound)) return 0;
    *sum += z * bound;
    *noise += fabs(z) * fmax(KINQP_QP_RELATIVE * fabs(bound), KINQP_QP_NOISE * (entries > 0.0 ? entries : 1.0));
    return 1;
}

int kinqp_qp_crossed(double l, double u, double entries) {
    const double noise = KINQP_QP_NOISE * (entries > 0.0 ? entries : 1.0);
    return l - u > 2.0 * fmax(KINQP_QP_RELATIVE * fmax(fabs(l), fabs(u)), noise);
}

int kinqp_qp_proves_infeasible(const kinqp_qp *qp, const kinqp_qp_solution *s) {
    const int n = qp->n;
    double sum = 0.0, noise = 0.0, most = 0.0, largest = 0.0;
    for (int i = 0; i < qp->m; ++i)
        if (kinqp_qp_crossed(lower(qp->l, i), upper(qp->u, i), kinqp_qp_entries(qp->C + i * n, n))) return 1;
    for (int i = 0; i < n; ++i)
        if (kinqp_qp_crossed(lower(qp->lb, i), upper(qp->ub, i), 1.0)) return 1;
    for (int i = 0; i < qp->p; ++i)
        if (!support(s->y[i], qp->b[i], qp->b[i], kinqp_qp_entries(qp->A + i * n, n), &sum, &noise)) return 0;
    for (int i = 0; i < qp->m; ++i)
        if (!support(s->z[i], lower(qp->l, i), upper(qp->u, i), kinqp_qp_entries(qp->C + i * n, n), &sum, &noise))
            return 0;
    for (int i = 0; i < n; ++i)
        if (!support(s->z_box[i], lower(qp->lb, i), upper(qp->ub, i), 1.0, &sum, &noise)) return 0;
    for (int j = 0; j < n; ++j) {
        double value = s->z_box[j], part = fabs(value);
        for (int i = 0; i < qp->p; ++i) {
            value += qp->A[i * n + j] * s->y[i];
            part += fabs(qp->A[i * n + j] * s->y[i]);
        }
        for (int i = 0; i < qp->m; ++i) {
            value += qp->C[i * n + j] * s->z[i];
            part += fabs(qp->C[i * n + j] * s->z[i]);
        }
        most = worse(most, fabs(value));
        largest = worse(largest, part);
    }
    return most <= KINQP_CERTIFICATE_TOLERANCE * largest && sum < -KINQP_PROOF * noise;
}

/* 1 if a row with this slope may be followed for ever; size: the slope's largest possible term. */
static int recedes(double slope, double size, double l, double u) {
    const double slack = KINQP_CERTIFICATE_TOLERANCE * size;
    if (kinqp_qp_is_finite(u) && slope > slack) return 0;
    if (kinqp_qp_is_finite(l) && slope < -slack) return 0;
    return !kinqp_qp_is_nan(slope);
}

int kinqp_qp_proves_unbounded(const kinqp_qp *qp, const double *d) {
    const int n = qp->n;
    const double reach = longest(d, n);
    double slope, terms, entries;
    for (int i = 0; i < n; ++i) {
        slope = product(qp->H + i * n, d, n, &terms, &entries);
        if (!recedes(slope, longest(qp->H + i * n, n) * reach, 0.0, 0.0)) return 0;
        if (!recedes(d[i], reach, lower(qp->lb, i), upper(qp->ub, i))) return 0;
    }
    for (int i = 0; i < qp->p; ++i) {
        slope = product(qp->A + i * n, d, n, &terms, &entries);
        if (!recedes(slope, longest(qp->A + i * n, n) * reach, 0.0, 0.0)) return 0;
    }
    for (int i = 0; i < qp->m; ++i) {
        slope = product(qp->C + i * n, d, n, &terms, &entries);
        if (!recedes(slope, longest(qp->C + i * n, n) * reach, lower(qp->l, i), upper(qp->u, i))) return 0;
    }
    slope = product(qp->g, d, n, &terms, &entries);
    return slope < -KINQP_CERTIFICATE_TOLERANCE * terms;
}

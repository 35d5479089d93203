/* KKT residuals and certificates of the canonical QP, from the caller's data alone. */
#include <float.h>
#include <math.h>

#include "kinqp_qp.h"

#define KINQP_CERTIFICATE_TOLERANCE 1e-8 /* relative residual of a certificate [-] */
#define KINQP_NET_WEIGHT 2e-3            /* weight of the stationarity residual relative to net sums [-] */

static double lower(const double *bounds, int i) { return bounds ? bounds[i] : -HUGE_VAL; }
static double upper(const double *bounds, int i) { return bounds ? bounds[i] : HUGE_VAL; }

/* Largest of a and b; NaN in either gives infinity, so that a residual cannot hide one. */
static double worse(double a, double b) {
    if (a != a || b != b) return HUGE_VAL;
    return a > b ? a : b;
}

/* Row product; *terms gets the sum of the absolute terms. */
static double product(const double *row, const double *x, int n, double *terms) {
    double sum = 0.0;
    *terms = 0.0;
    for (int j = 0; j < n; ++j) {
        sum += row[j] * x[j];
        *terms += fabs(row[j] * x[j]);
    }
    return sum;
}

/* The solution's length in scaled variables: of x, and of the unconstrained minimiser if H has a diagonal. */
static double solution_length(const kinqp_qp *qp, const double *scale, const double *x) {
    double length = 0.0;
    for (int j = 0; j < qp->n; ++j) {
        const double unit = scale ? scale[j] : 1.0;
        length = worse(length, fabs(x[j]) / unit);
        if (qp->H[j * qp->n + j] > 0.0) length = worse(length, fabs(qp->g[j]) * unit);
    }
    return length;
}

/* Size of a row's largest product over all points of the solution's length. */
static double row_reach(const double *row, const double *scale, int n, double length) {
    double sum = 0.0;
    for (int j = 0; j < n; ++j) sum += fabs(row[j]) * (scale ? scale[j] : 1.0);
    return sum * length;
}

/* One two-sided row: updates the worst relative violation and the complementarity product. */
static void row_residual(double value, double reach, double l, double u, double z, kinqp_qp_solution *s, double *size) {
    const double outside = value > u ? value - u : (value < l ? l - value : 0.0);
    if (outside > 0.0) {
        const double bound = fabs(value > u ? u : l);
        s->primal = worse(s->primal, outside / (bound > reach ? bound : reach));
    }
    s->primal = worse(s->primal, value != value ? value : 0.0);
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

void kinqp_qp_residuals(const kinqp_qp *qp, const double *scale, kinqp_qp_solution *s) {
    const int n = qp->n;
    const double length = solution_length(qp, scale, s->x);
    double terms, size = 0.0, most = 0.0, largest = 0.0, rest = 0.0, net = 0.0;
    s->primal = 0.0;
    s->dual = 0.0;
    s->gap = 0.0;
    for (int i = 0; i < qp->p; ++i) {
        const double *row = qp->A + i * n;
        const double b = qp->b[i];
        row_residual(product(row, s->x, n, &terms), row_reach(row, scale, n, length), b, b, 0.0, s, &size);
    }
    for (int i = 0; i < qp->m; ++i) {
        const double *row = qp->C + i * n;
        row_residual(product(row, s->x, n, &terms), row_reach(row, scale, n, length), lower(qp->l, i),
                     upper(qp->u, i), s->z[i], s, &size);
    }
    for (int i = 0; i < n; ++i)
        row_residual(s->x[i], length * (scale ? scale[i] : 1.0), lower(qp->lb, i), upper(qp->ub, i), s->z_box[i], s,
                     &size);
    for (int j = 0; j < n; ++j) {
        const double unit = scale ? scale[j] : 1.0;
        const double slope = product(qp->H + j * n, s->x, n, &terms);
        double pull = s->z_box[j], part = fabs(qp->g[j]) + fabs(s->z_box[j]);
        size = worse(size, fabs(slope * s->x[j]));
        size = worse(size, fabs(qp->g[j] * s->x[j]));
        for (int i = 0; i < qp->p; ++i) {
            pull += qp->A[i * n + j] * s->y[i];
            part += fabs(qp->A[i * n + j] * s->y[i]);
        }
        for (int i = 0; i < qp->m; ++i) {
            pull += qp->C[i * n + j] * s->z[i];
            part += fabs(qp->C[i * n + j] * s->z[i]);
        }
        most = worse(most, unit * fabs(slope + qp->g[j] + pull));
        largest = worse(largest, unit * (terms + part));
        rest = worse(rest, fabs(slope + qp->g[j] + pull));
        net = worse(net, worse(fabs(slope), worse(fabs(qp->g[j]), fabs(pull))));
        net = worse(net, longest(qp->H + j * n, n));
    }
    /* Against net sums too: an x that runs away along a flat direction makes any residual small against its terms. */
    s->dual = most > 0.0 ? worse(most / largest, KINQP_NET_WEIGHT * rest / net) : most;
    s->gap = s->gap > 0.0 ? worse(0.0, s->gap / size) : s->gap;
}

/* Support of one row for multiplier z; 0 for z on an absent side makes the certificate void. */
static int support(double z, double l, double u, double *sum, double *terms) {
    const double bound = z < 0.0 ? l : u;
    if (!(z < 0.0) && !(z > 0.0)) return z == z;
    if (!(fabs(bound) <= DBL_MAX)) return 0;
    *sum += z * bound;
    *terms += fabs(z * bound);
    return 1;
}

int kinqp_qp_proves_infeasible(const kinqp_qp *qp, const kinqp_qp_solution *s) {
    const int n = qp->n;
    double sum = 0.0, terms = 0.0, most = 0.0, largest = 0.0;
    for (int i = 0; i < qp->m; ++i)
        if (lower(qp->l, i) > upper(qp->u, i)) return 1;
    for (int i = 0; i < n; ++i)
        if (lower(qp->lb, i) > upper(qp->ub, i)) return 1;
    for (int i = 0; i < qp->p; ++i)
        if (!support(s->y[i], qp->b[i], qp->b[i], &sum, &terms)) return 0;
    for (int i = 0; i < qp->m; ++i)
        if (!support(s->z[i], lower(qp->l, i), upper(qp->u, i), &sum, &terms)) return 0;
    for (int i = 0; i < n; ++i)
        if (!support(s->z_box[i], lower(qp->lb, i), upper(qp->ub, i), &sum, &terms)) return 0;
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
    return most <= KINQP_CERTIFICATE_TOLERANCE * largest && sum < -0.1 * KINQP_CERTIFICATE_TOLERANCE * terms;
}

/* 1 if a row with this slope may be followed for ever; size: the slope's largest possible term. */
static int recedes(double slope, double size, double l, double u) {
    const double slack = KINQP_CERTIFICATE_TOLERANCE * size;
    if (u <= DBL_MAX && slope > slack) return 0;
    if (l >= -DBL_MAX && slope < -slack) return 0;
    return slope == slope;
}

int kinqp_qp_proves_unbounded(const kinqp_qp *qp, const double *d) {
    const int n = qp->n;
    const double reach = longest(d, n);
    double slope, terms;
    for (int i = 0; i < n; ++i) {
        slope = product(qp->H + i * n, d, n, &terms);
        if (!recedes(slope, longest(qp->H + i * n, n) * reach, 0.0, 0.0)) return 0;
        if (!recedes(d[i], reach, lower(qp->lb, i), upper(qp->ub, i))) return 0;
    }
    for (int i = 0; i < qp->p; ++i) {
        slope = product(qp->A + i * n, d, n, &terms);
        if (!recedes(slope, longest(qp->A + i * n, n) * reach, 0.0, 0.0)) return 0;
    }
    for (int i = 0; i < qp->m; ++i) {
        slope = product(qp->C + i * n, d, n, &terms);
        if (!recedes(slope, longest(qp->C + i * n, n) * reach, lower(qp->l, i), upper(qp->u, i))) return 0;
    }
    slope = product(qp->g, d, n, &terms);
    return slope < -KINQP_CERTIFICATE_TOLERANCE * terms;
}

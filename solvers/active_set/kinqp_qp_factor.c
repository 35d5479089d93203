/* Dense factorisations of the front end: pivoted Householder for the equalities, pivoted Cholesky for the Hessian. */
#include <math.h>

#include "kinqp_qp_internal.h"

#define KINQP_PIVOT_NOISE 1e-14    /* pivots below this, relative to the largest, are rounding [-] */
#define KINQP_RANK_TOLERANCE 1e-11 /* an equality is dependent if less than this of its unit length is left [-] */

double kinqp_qp_power(double value) {
    int exponent;
    if (!(value > 0.0) || !kinqp_qp_is_finite(value)) return 1.0;
    (void)frexp(value, &exponent);
    return ldexp(1.0, 1 - exponent);
}

double kinqp_qp_dot(const double *a, const double *b, int n) {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
}

double kinqp_qp_entries(const double *row, int n) {
    double sum = 0.0;
    for (int j = 0; j < n; ++j) sum += fabs(row[j]);
    return sum;
}

/* v := (I - tau h h') v for the reflector j, whose first entry is 1 and not stored. */
static void reflect(const kinqp_qp_work *k, int j, double *v) {
    const double *h = k->eqfactor + k->pivot[j] * k->n;
    double sum = v[j];
    for (int i = j + 1; i < k->n; ++i) sum += h[i] * v[i];
    sum *= k->tau[j];
    v[j] -= sum;
    for (int i = j + 1; i < k->n; ++i) v[i] -= sum * h[i];
}

void kinqp_qp_factor_equalities(kinqp_qp_work *k) {
    const int n = k->n, count = k->equalities;
    for (int i = 0; i < count; ++i) k->pivot[i] = i;
    k->rank = 0;
    for (int j = 0; j < n && j < count; ++j) {
        int best = -1;
        double top = KINQP_RANK_TOLERANCE * KINQP_RANK_TOLERANCE;
        for (int i = j; i < count; ++i) {
            const double *row = k->eqfactor + k->pivot[i] * n;
            const double left = kinqp_qp_dot(row + j, row + j, n - j);
            if (left > top) {
                top = left;
                best = i;
            }
        }
        if (best < 0) return;
        KINQP_ASSERT(j < n && best >= j && best < count); /* the loop ends at n: rank <= n */
        const int chosen = k->pivot[best];
        k->pivot[best] = k->pivot[j];
        k->pivot[j] = chosen;
        double *h = k->eqfactor + chosen * n;
        const double length = sqrt(top), first = h[j];
        const double diagonal = first > 0.0 ? -length : length;
        const double head = first - diagonal;
        k->tau[j] = -head / diagonal;
        k->diagonal[j] = diagonal;
        for (int i = j + 1; i < n; ++i) h[i] /= head;
        h[j] = diagonal;
        k->rank = j + 1;
        for (int i = j + 1; i < count; ++i) reflect(k, j, k->eqfactor + k->pivot[i] * n);
    }
}

void kinqp_qp_apply_transposed(const kinqp_qp_work *k, double *v) {
    for (int j = 0; j < k->rank; ++j) reflect(k, j, v);
}

void kinqp_qp_apply(const kinqp_qp_work *k, double *v) {
    for (int j = k->rank - 1; j >= 0; --j) reflect(k, j, v);
}

void kinqp_qp_equality_duals(const kinqp_qp_work *k, double *v, double *ey) {
    for (int i = 0; i < k->equalities; ++i) ey[i] = 0.0;
    kinqp_qp_apply_transposed(k, v);
    for (int j = k->rank - 1; j >= 0; --j) {
        const double *column = k->eqfactor + k->pivot[j] * k->n;
        const double value = v[j] / k->diagonal[j];
        ey[k->pivot[j]] = value;
        for (int i = 0; i < j; ++i) v[i] -= column[i] * value;
    }
}

void kinqp_qp_restore_equalities(const kinqp_qp_work *k, double *x) {
    double *t = k->v;
    for (int i = 0; i < k->n; ++i) t[i] = 0.0;
    for (int j = 0; j < k->rank; ++j) { /* rank <= n: the factorisation takes one of n columns a time */
        const double *column = k->eqfactor + k->pivot[j] * k->n;
        double value = k->e[k->pivot[j]] - kinqp_qp_dot(k->eqmat + k->pivot[j] * k->n, x, k->n);
        for (int i = 0; i < j; ++i) value -= column[i] * t[i];
        t[j] = value / k->diagonal[j];
    }
    kinqp_qp_apply(k, t);
    for (int i = 0; i < k->n; ++i) x[i] += t[i];
}

double kinqp_qp_cholesky(kinqp_qp_work *k, double shift) {
    const int n = k->free;
    double *chol = k->chol, largest = 0.0, smallest = HUGE_VAL, reference = 0.0;
    for (int i = 0; i < n; ++i) {
        k->kpivot[i] = i;
        for (int j = 0; j < n; ++j) chol[i * n + j] = k->curv[i * n + j];
        chol[i * n + i] += shift;
        if (chol[i * n + i] > largest) largest = chol[i * n + i];
    }
    if (shift <= 0.0) /* against the whole Hessian: what is left of it may be rounding alone */
        for (int i = 0; i < k->n; ++i) reference = fmax(reference, k->hess[i * k->n + i]);
    reference = fmax(reference, largest);
    for (int j = 0; j < n; ++j) {
        int best = j;
        for (int i = j + 1; i < n; ++i)
            if (chol[i * n + i] > chol[best * n + best]) best = i;
        const double pivot = chol[best * n + best];
        if (pivot < smallest) smallest = pivot;
        for (int i = j; i < n; ++i)
            if (chol[i * n + i] < smallest) smallest = chol[i * n + i];
        if (!(pivot > KINQP_PIVOT_NOISE * largest)) return reference > 0.0 ? smallest / reference : smallest;
        if (best != j) {
            const int swap = k->kpivot[j];
            k->kpivot[j] = k->kpivot[best];
            k->kpivot[best] = swap;
            for (int c = 0; c < n; ++c) { /* rows, then columns, of the full square */
                const double a = chol[j * n + c];
                chol[j * n + c] = chol[best * n + c];
                chol[best * n + c] = a;
            }
            for (int r = 0; r < n; ++r) {
                const double a = chol[r * n + j];
                chol[r * n + j] = chol[r * n + best];
                chol[r * n + best] = a;
            }
        }
        const double root = sqrt(pivot), inverse = 1.0 / root;
        chol[j * n + j] = root;
        for (int i = j + 1; i < n; ++i) chol[i * n + j] *= inverse;
        for (int i = j + 1; i < n; ++i) {
            const double a = chol[i * n + j];
            for (int c = j + 1; c <= i; ++c) chol[i * n + c] -= a * chol[c * n + j];
            for (int c = j + 1; c < i; ++c) chol[c * n + i] = chol[i * n + c];
        }
        for (int c = j + 1; c < n; ++c) chol[j * n + c] = 0.0;
    }
    return n > 0 ? smallest / reference : 1.0;
}

void kinqp_qp_whiten(kinqp_qp_work *k, int m) {
    const int n = k->n, f = k->free;
    for (int i = 0; i < n; ++i) {
        double *t = k->white + i * f;
        for (int j = 0; j < f; ++j) {
            const double *row = k->chol + j * f;
            double value = k->basis[i * f + k->kpivot[j]];
            for (int c = 0; c < j; ++c) value -= row[c] * t[c];
            t[j] = value / row[j];
        }
    }
    for (int r = 0; r < k->rows; ++r) {
        double *row = k->whiterows + r * f;
        if (k->id[r] >= m) {
            const double *t = k->white + (k->id[r] - m) * f;
            for (int j = 0; j < f; ++j) row[j] = t[j];
            continue;
        }
        const double *c = k->rowmat + k->id[r] * n;
        for (int j = 0; j < f; ++j) row[j] = 0.0;
        for (int i = 0; i < n; ++i)
            if (c[i] != 0.0)
                for (int j = 0; j < f; ++j) row[j] += c[i] * k->white[i * f + j];
    }
}

/* Householder reflections that take m rows over n columns (padded) to a triangle, the largest row next. There
 * may be more rows than columns: the rank is at most n.
 *
 * rows: overwritten by the reflections, in the order `order`, with factors beta (m,). along (m,): the smallest solution of
 * rows x = b in the axes that the reflections give. Returns the rank, or -1 if the equalities contradict each other by more
 * than 1e-9. A row counts as dependent below 1e-10 of its length, or below 1e-14 of the longest row: a joint that can't move
 * a row leaves rounding there, which is no equation. What is asked of such a row may be as far off. */
KINQP_INLINE int kinqp_reflect(int m, int n, double *rows, const double *b, double *beta, double *along, int *order) {
    const int stride = kinqp_padded(n);
    double length2[KINQP_EQUALITIES], rest2[KINQP_EQUALITIES], triangle[KINQP_EQUALITIES * KINQP_LARGEST], head[KINQP_LARGEST];
    const int most = m < n ? m : n;
    double longest2 = 0.0;
    int rank = 0;
    KINQP_ASSERT(m <= KINQP_EQUALITIES && n <= KINQP_LARGEST);
    for (int i = 0; i < m; ++i) {
        length2[i] = rest2[i] = kinqp_dot_padded(stride, rows + i * stride, rows + i * stride);
        longest2 = length2[i] > longest2 ? length2[i] : longest2;
        order[i] = i;
    }
    const double noise2 = 1e-28 * longest2;
    for (; rank < most; ++rank) {
        /* The row with the largest share still outside the span of those before. */
        int best = -1;
        double rest = 1e-20, whole = 1.0;
        for (int i = rank; i < m; ++i) {
            if (rest2[order[i]] * whole > rest * length2[order[i]] && rest2[order[i]] > noise2) {
                rest = rest2[order[i]];
                whole = length2[order[i]];
                best = i;
            }
        }
        if (best < 0) break;
        const int chosen = order[best];
        order[best] = order[rank];
        order[rank] = chosen;
        /* The reflection that takes the rest of this row to a multiple of the axis `rank` < n; its vector stays in the row. */
        double *row = rows + chosen * stride;
        const double norm = sqrt(rest);
        head[rank] = row[rank] > 0.0 ? -norm : norm;
        row[rank] -= head[rank];
        beta[rank] = 1.0 / (norm * fabs(row[rank]));
        for (int i = rank + 1; i < m; ++i) {
            double *other = rows + order[i] * stride;
            kinqp_add_padded(stride, other, -beta[rank] * kinqp_dot_padded(stride, row, other), row, other);
            triangle[order[i] * most + rank] = other[rank];
            other[rank] = 0.0;
            rest2[order[i]] = kinqp_dot_padded(stride, other, other);
        }
    }
    /* Forward substitution with the triangle that the reflections left. */
    for (int i = 0; i < m; ++i) {
        double value = b[order[i]], terms = fabs(value);
        for (int k = 0; k < (i < rank ? i : rank); ++k) {
            value -= triangle[order[i] * most + k] * along[k];
            terms += fabs(triangle[order[i] * most + k] * along[k]);
        }
        if (i < rank) along[i] = value / head[i];
        else if (!(fabs(value) <= 1e-9 * (terms + sqrt(length2[order[i]])) + 1e-12 * sqrt(longest2))) return -1;
    }
    return rank;
}

/* basis (n, width): an orthonormal basis of the null space in its first n - rank columns, the others zero, by the reflections
 * of kinqp_reflect on the axes that belong to it. x (n,): the smallest solution of rows x = b. */
KINQP_INLINE void kinqp_null_basis(int n, int rank, int width, const double *rows, const double *beta, const double *along,
                                    const int *order, double *basis, double *x) {
    const int stride = kinqp_padded(n);
    int moved = 0;
    KINQP_ASSERT(rank <= n && width % 4 == 0 && n - rank <= width);
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < width; ++j) basis[i * width + j] = i == j + rank ? 1.0 : 0.0;
        x[i] = i < rank ? along[i] : 0.0;
        moved |= x[i] < 0.0 || x[i] > 0.0;
    }
    for (int k = rank - 1; k >= 0; --k) {
        const double *row = rows + order[k] * stride;
        for (int c = 0; c < width; c += 4) {
            kinqp_lanes shares, entry;
            double some[4];
            kinqp_scaled(row[k], basis + k * width + c, &shares);
            for (int i = k + 1; i < n; ++i) kinqp_add_scaled(row[i], basis + i * width + c, &shares);
            kinqp_store(some, &shares);
            for (int i = k; i < n; ++i) {
                kinqp_load(basis + i * width + c, &entry);
                kinqp_add_scaled(-beta[k] * row[i], some, &entry);
                kinqp_store(basis + i * width + c, &entry);
            }
        }
        if (moved) {
            double share = 0.0;
            for (int i = k; i < n; ++i) share += row[i] * x[i];
            for (int i = k; i < n; ++i) x[i] -= beta[k] * row[i] * share;
        }
    }
}

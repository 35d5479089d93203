/* Arrays that run over joints are padded with zeros to a multiple of four, so that loops over them have no remainder. */
KINQP_INLINE int kinqp_padded(int n) { return (n + 3) / 4 * 4; }

/* out := a + share * b, over a multiple of four entries. */
KINQP_INLINE void kinqp_add_padded(int n, const double *a, double share, const double *b, double *out) {
    KINQP_ASSERT(n % 4 == 0);
    for (int i = 0; i < n; i += 4) {
        kinqp_lanes x;
        kinqp_load(a + i, &x);
        kinqp_add_scaled(share, b + i, &x);
        kinqp_store(out + i, &x);
    }
}

/* inverse (m, m) := the inverse of a symmetric positive definite matrix, m <= 6, by L D L' without pivoting. Returns the
 * product of the shares of its diagonal entries that are left as pivots: 1 for orthogonal rows, 0 for dependent ones. */
KINQP_INLINE double kinqp_inverse_by_factors(int m, const double *matrix, double *inverse) {
    double factor[36], scaled[36], reciprocal[6], independence = 1.0;
    KINQP_ASSERT(m <= 6); /* rows of a twist */
    for (int j = 0; j < m; ++j) {
        for (int i = j; i < m; ++i) {
            double value = matrix[i * m + j];
            for (int k = 0; k < j; ++k) value -= factor[i * m + k] * scaled[j * m + k];
            scaled[i * m + j] = value;
        }
        const double pivot = scaled[j * m + j];
        independence *= pivot / matrix[j * m + j];
        reciprocal[j] = 1.0 / pivot;
        for (int i = j + 1; i < m; ++i) factor[i * m + j] = scaled[i * m + j] * reciprocal[j];
    }
    for (int c = 0; c < m; ++c) {
        double x[6];
        for (int i = c; i < m; ++i) {
            x[i] = i == c ? 1.0 : 0.0;
            for (int k = c; k < i; ++k) x[i] -= factor[i * m + k] * x[k];
        }
        for (int i = m - 1; i >= c; --i) {
            x[i] *= reciprocal[i];
            for (int k = i + 1; k < m; ++k) x[i] -= factor[k * m + i] * x[k];
        }
        for (int i = c; i < m; ++i) inverse[i * m + c] = inverse[c * m + i] = x[i];
    }
    return independence;
}

/* scale * inverse: the same, and whether the matrix is far from singular: that product is at least 1e-4. Three rows by
 * cofactors, whose chains are short, exact enough while this holds; what multiplies them need not wait for `scale`, the
 * reciprocal of the determinant. */
KINQP_INLINE int kinqp_inverse_of_positive(int m, const double *matrix, double *inverse, double *scale) {
    *scale = 1.0;
    if (m != 3) return kinqp_inverse_by_factors(m, matrix, inverse) > 1e-4;
    const double a = matrix[0], b = matrix[1], c = matrix[2], d = matrix[4], e = matrix[5], f = matrix[8];
    inverse[0] = d * f - e * e;
    inverse[1] = inverse[3] = c * e - b * f;
    inverse[2] = inverse[6] = b * e - c * d;
    inverse[4] = a * f - c * c;
    inverse[5] = inverse[7] = b * c - a * e;
    inverse[8] = a * d - b * b;
    const double determinant = a * inverse[0] + (b * inverse[1] + c * inverse[2]);
    *scale = 1.0 / determinant;
    return determinant > 1e-4 * (a * (d * f));
}

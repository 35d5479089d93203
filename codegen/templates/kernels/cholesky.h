/* matrix = L D L' with unit lower L, the factor; both row-major with `stride` entries a row. reciprocal = 1 / D. 0 if the
 * matrix is not positive definite. */
KINQP_INLINE int kinqp_factor(int n, int stride, const double *matrix, double *factor, double *reciprocal) {
    double scaled[KINQP_LARGEST * KINQP_LARGEST];
    int positive = 1;
    KINQP_ASSERT(n <= KINQP_LARGEST && n <= stride);
    for (int j = 0; j < n; ++j) {
        for (int i = j; i < n; ++i) {
            double value = matrix[i * stride + j];
            for (int k = 0; k < j; ++k) value -= factor[i * stride + k] * scaled[j * n + k];
            scaled[i * n + j] = value;
        }
        positive &= scaled[j * n + j] > 1e-13 * matrix[j * stride + j];
        reciprocal[j] = 1.0 / scaled[j * n + j];
        for (int i = j + 1; i < n; ++i) factor[i * stride + j] = scaled[i * n + j] * reciprocal[j];
    }
    return positive;
}

/* y = L^-1 in. */
KINQP_INLINE void kinqp_forward(int n, int stride, const double *factor, const double *in, double *y) {
    for (int i = 0; i < n; ++i) {
        double value = in[i];
        for (int k = 0; k < i; ++k) value -= factor[i * stride + k] * y[k];
        y[i] = value;
    }
}

/* out = L^-T (scale in), entry by entry. */
KINQP_INLINE void kinqp_backward(int n, int stride, const double *factor, const double *scale, const double *in, double *out) {
    for (int i = n - 1; i >= 0; --i) {
        double value = in[i] * scale[i];
        for (int k = i + 1; k < n; ++k) value -= factor[k * stride + i] * out[k];
        out[i] = value;
    }
}

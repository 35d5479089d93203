static inline double kinqp_dot(int n, const double *a, const double *b) {
    double sum = 0.0;
    for (int i = 0; i < n; ++i) sum += a[i] * b[i];
    return sum;
}

static inline int kinqp_finite(int n, const double *values) {
    /* Four sums: one would be a long chain. */
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    for (int i = 0; i < n; ++i) sum[i % 4] += values[i] * 0.0;
    return (sum[0] + sum[1]) + (sum[2] + sum[3]) == 0.0;
}


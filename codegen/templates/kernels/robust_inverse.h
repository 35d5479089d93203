/* inverse: J' (J J' + lambda^2 I)^-1 of m rows J over n joints (padded), its columns padded; see `robust_inverse` in
 * kinqp.formulations. qd (n, padded): inverse v + offset. Where the smallest singular value is surely above the threshold,
 * lambda is zero. */
KINQP_INLINE void kinqp_robust_inverse(int m, int n, const double *rows, double threshold, double damping_max,
                                       const double *v, const double *offset, double *inverse, double *qd) {
    const int stride = kinqp_padded(n);
    const double least = threshold * threshold;
    double gram[36], gram_inverse[36], scale, trace = 0.0, frobenius2 = 0.0;
    KINQP_ASSERT(m <= 6); /* rows of a twist */
    for (int i = 0; i < m; ++i) {
        for (int j = 0; j <= i; ++j)
            gram[i * m + j] = gram[j * m + i] = kinqp_dot_padded(stride, rows + i * stride, rows + j * stride);
        trace += gram[i * m + i];
    }
    const int regular = kinqp_inverse_of_positive(m, gram, gram_inverse, &scale);
    for (int i = 0; i < m; ++i) {
        for (int j = 0; j < i; ++j) frobenius2 += 2.0 * (gram_inverse[i * m + j] * gram_inverse[i * m + j]);
        frobenius2 += gram_inverse[i * m + i] * gram_inverse[i * m + i];
    }
    if (!regular || !(least * least * (frobenius2 * (scale * scale)) < 0.9999)) {
        /* A shift far below any threshold in use keeps the inverse finite at the singularity itself. */
        const double shift = 1e-12 * trace + 1e-100;
        double moved[36];
        for (int i = 0; i < m * m; ++i) moved[i] = gram[i];
        for (int i = 0; i < m; ++i) moved[i * m + i] += shift;
        kinqp_inverse_by_factors(m, moved, gram_inverse);
        frobenius2 = 0.0;
        for (int i = 0; i < m * m; ++i) frobenius2 += gram_inverse[i] * gram_inverse[i];
        const double weakness = 1.0 - 1.0 / (sqrt(frobenius2) * least);
        const double damping = damping_max * (weakness > 0.0 ? weakness : 0.0);
        for (int i = 0; i < m; ++i) gram[i * m + i] += damping * damping;
        kinqp_inverse_by_factors(m, gram, gram_inverse);
        scale = 1.0;
    }
    for (int b = 0; b < stride; b += 4) {
        kinqp_lanes value, moved;
        kinqp_load(offset + b, &moved);
        for (int r = 0; r < m; ++r) {
            kinqp_scaled(gram_inverse[r * m], rows + b, &value);
            for (int k = 1; k < m; ++k) kinqp_add_scaled(gram_inverse[r * m + k], rows + k * stride + b, &value);
            kinqp_multiply(scale, &value);
            kinqp_store(inverse + r * stride + b, &value);
            kinqp_add_times(v[r], &value, &moved);
        }
        kinqp_store(qd + b, &moved);
    }
}

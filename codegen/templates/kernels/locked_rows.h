/* As kinqp_locked_rows, by Gram-Schmidt with dependent rows dropped: for where the locked rows are close to dependent. */
static void kinqp_locked_rows_dependent(int k, int m, int n, const double *guided, const double *locked, const double *v,
                                        double *J_bar, double *qd) {
    const int stride = kinqp_padded(n);
    double basis[6 * KINQP_MOST], share[6], shares_of[36];
    KINQP_ASSERT(m <= 6 && stride <= KINQP_MOST);
    for (int i = 0; i < stride; ++i) qd[i] = 0.0;
    for (int i = 0; i < m; ++i) {
        double *rest = basis + i * stride, asked = v[i];
        const double whole = kinqp_dot_padded(stride, locked + i * stride, locked + i * stride);
        double size = whole;
        for (int l = 0; l < stride; ++l) rest[l] = locked[i * stride + l];
        for (int j = 0; j < i; ++j) shares_of[i * 6 + j] = 0.0;
        for (int pass = 0; i > 0 && pass < 2; ++pass) {
            double along[6];
            for (int j = 0; j < i; ++j) along[j] = kinqp_dot_padded(stride, basis + j * stride, rest);
            for (int j = 0; j < i; ++j) {
                kinqp_add_padded(stride, rest, -along[j], basis + j * stride, rest);
                shares_of[i * 6 + j] += along[j];
            }
            size = kinqp_dot_padded(stride, rest, rest);
        }
        /* A row with less than this of it outside the others adds no direction. */
        const double reciprocal = size > 1e-20 * whole ? 1.0 / sqrt(size) : 0.0;
        for (int l = 0; l < stride; ++l) rest[l] *= reciprocal;
        for (int j = 0; j < i; ++j) asked -= shares_of[i * 6 + j] * share[j];
        share[i] = asked * reciprocal;
        kinqp_add_padded(stride, qd, share[i], rest, qd);
    }
    for (int i = 0; i < k; ++i) {
        double along[6];
        for (int j = 0; j < m; ++j) along[j] = kinqp_dot_padded(stride, guided + i * stride, basis + j * stride);
        for (int l = 0; l < stride; ++l) J_bar[i * stride + l] = guided[i * stride + l];
        for (int j = 0; j < m; ++j)
            kinqp_add_padded(stride, J_bar + i * stride, -along[j], basis + j * stride, J_bar + i * stride);
    }
}

/* J_bar (k, n): what of k guided rows lies outside the span of m locked rows; qd (n): the smallest joint velocity with
 * locked qd = v_fixed; v_left (k): v - guided qd. All rows padded. By the Gram matrix of the locked rows where that loses no
 * more than four digits. */
KINQP_INLINE void kinqp_locked_rows(int k, int m, int n, const double *guided, const double *locked, const double *v_fixed,
                                     const double *v, double *J_bar, double *qd, double *v_left) {
    const int stride = kinqp_padded(n);
    double gram[36], cross[36], inverse[36], scale;
    int drift = 0;
    KINQP_ASSERT(k + m <= 6); /* a mode's twist has six rows */
    for (int j = 0; j < m; ++j) drift |= v_fixed[j] < 0.0 || v_fixed[j] > 0.0;
    for (int l = 0; l < stride; ++l) qd[l] = 0.0;
    for (int i = 0; i < m; ++i)
        for (int j = 0; j <= i; ++j)
            gram[i * m + j] = gram[j * m + i] = kinqp_dot_padded(stride, locked + i * stride, locked + j * stride);
    for (int i = 0; i < k; ++i)
        for (int j = 0; j < m; ++j) cross[i * m + j] = kinqp_dot_padded(stride, guided + i * stride, locked + j * stride);
    if (kinqp_inverse_of_positive(m, gram, inverse, &scale)) {
        double shares[36];
        for (int i = 0; i < k; ++i)
            for (int j = 0; j < m; ++j) {
                double value = cross[i * m] * inverse[j];
                for (int l = 1; l < m; ++l) value += cross[i * m + l] * inverse[l * m + j];
                shares[i * m + j] = value * scale;
            }
        for (int b = 0; b < stride; b += 4) {
            kinqp_lanes rest;
            for (int i = 0; i < k; ++i) {
                kinqp_load(guided + i * stride + b, &rest);
                for (int j = 0; j < m; ++j) kinqp_add_scaled(-shares[i * m + j], locked + j * stride + b, &rest);
                kinqp_store(J_bar + i * stride + b, &rest);
            }
        }
        for (int j = 0; drift && j < m; ++j) {
            double along = inverse[j * m] * v_fixed[0];
            for (int l = 1; l < m; ++l) along += inverse[j * m + l] * v_fixed[l];
            kinqp_add_padded(stride, qd, along * scale, locked + j * stride, qd);
        }
    } else {
        kinqp_locked_rows_dependent(k, m, n, guided, locked, v_fixed, J_bar, qd);
    }
    for (int i = 0; i < k; ++i) v_left[i] = drift ? v[i] - kinqp_dot_padded(stride, guided + i * stride, qd) : v[i];
    for (int i = 0; i < k; ++i) {
        /* Entries that are nothing but rounding become zero: a joint that can't take part would otherwise get a tiny
         * coefficient of random sign and, resting on its limit, block half of all directions with it. */
        const double noise = 1e-24 * kinqp_dot_padded(stride, guided + i * stride, guided + i * stride);
        for (int b = 0; b < stride; b += KINQP_WIDTH) {
            const kinqp_part entry = kinqp_part_load(J_bar + i * stride + b), zero = kinqp_part_fill(0.0);
            const kinqp_part kept = kinqp_part_choose(entry * entry, kinqp_part_fill(noise), entry, zero);
            kinqp_part_store(J_bar + i * stride + b, kept);
        }
    }
}

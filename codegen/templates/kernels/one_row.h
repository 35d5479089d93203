/* First step of the least distance from w = 0 subject to lo <= M w <= hi: most often one row is all that it takes.
 *
 * columns (n, m): M by columns, padded as lo and hi are. gap, norm2, weight (m): as in the solver's state, padded. w (n):
 * the nearest point on the row farthest away, `first`; multiplier: of that row. score, next: the squared distance and the
 * row farthest outside there, -1 if none is. Returns 0 if the data call for more care: a row of no or no usable length,
 * sides that cross, NaN. */
KINQP_INLINE int kinqp_one_row(int n, int m, const double *columns, const double *lo, const double *hi, double *gap,
                               double *norm2, double *weight, double *w, int *first, double *multiplier, int *next,
                               double *score) {
    const int stride = kinqp_padded(m);
    double scores[KINQP_ROWS], best = 0.0, around = 0.0;
    KINQP_ASSERT(stride <= KINQP_ROWS);
    const kinqp_part zero = kinqp_part_fill(0.0), one = kinqp_part_fill(1.0);
    int usable = 1, row = -1;
    for (int b = 0; b < stride; b += KINQP_WIDTH) {
        const kinqp_part low = kinqp_part_load(lo + b), high = kinqp_part_load(hi + b);
        kinqp_part size = kinqp_part_load(columns + b) * kinqp_part_load(columns + b);
        for (int j = 1; j < n; ++j) {
            const kinqp_part entry = kinqp_part_load(columns + j * stride + b);
            size += entry * entry;
        }
        const kinqp_part outside = kinqp_part_choose(low, -high, low, -high);
        const kinqp_part positive = kinqp_part_choose(outside, zero, outside, zero);
        const kinqp_part per = kinqp_part_choose(size, zero, one / size, zero);
        kinqp_part_store(norm2 + b, size);
        kinqp_part_store(weight + b, per);
        kinqp_part_store(gap + b, outside);
        kinqp_part_store(scores + b, positive * positive * per);
    }
    for (int i = 0; i < m; ++i) {
        usable &= (norm2[i] > 1e-250) & (norm2[i] < 1e250) & (hi[i] >= lo[i]);
        row = scores[i] > best ? i : row;
        best = scores[i] > best ? scores[i] : best;
    }
    *score = best;
    *first = row;
    if (!usable || row < 0) return 0;
    const double step = gap[row] * weight[row], signed_step = lo[row] > 0.0 ? step : -step;
    for (int j = 0; j < n; ++j) w[j] = signed_step * columns[j * stride + row];
    weight[row] = 0.0;
    *multiplier = -signed_step;
    for (int b = 0; b < stride; b += KINQP_WIDTH) {
        kinqp_part value = kinqp_part_fill(w[0]) * kinqp_part_load(columns + b);
        for (int j = 1; j < n; ++j) value += kinqp_part_fill(w[j]) * kinqp_part_load(columns + j * stride + b);
        const kinqp_part above = value - kinqp_part_load(hi + b), below = kinqp_part_load(lo + b) - value;
        const kinqp_part outside = kinqp_part_choose(below, above, below, above);
        kinqp_part_store(gap + b, outside);
    }
    *next = -1;
    for (int i = 0; i < m; ++i) {
        const double value = gap[i] * fabs(gap[i]) * weight[i];
        *next = value > around ? i : *next;
        around = value > around ? value : around;
    }
    *score = around;
    return 1;
}

/* Four numbers at a time, by the compiler's own vectors where it has them; the same bits whatever the machine's width. */
#ifndef KINQP_LANES_H
#define KINQP_LANES_H

#include <math.h>

/* What is checked here can't be checked where a compiler may assume that there is no NaN, or reorder sums. */
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__) || defined(__ASSOCIATIVE_MATH__)
#error "kinqp: compile without -ffast-math, -Ofast and -ffinite-math-only; numbers have to behave as IEEE 754 says"
#endif

/* What the bounds of arrays rest on; looked at only where KINQP_DEBUG is defined. */
#if defined(KINQP_ASSERT)
#elif defined(KINQP_DEBUG)
#include <stdio.h>
#include <stdlib.h>
#define KINQP_ASSERT(holds) \
    ((holds) ? (void)0 : (fprintf(stderr, "%s:%d: expected %s\n", __FILE__, __LINE__, #holds), abort()))
#else
#define KINQP_ASSERT(holds) ((void)0)
#endif

#if defined(__GNUC__)
/* Not every library needs every one of these. */
#define KINQP_INLINE static inline __attribute__((unused))
#define KINQP_VECTOR(type, size) type __attribute__((vector_size(size), aligned(8), may_alias))
#if defined(__AVX__)
#include <immintrin.h>
typedef KINQP_VECTOR(double, 32) kinqp_part;
typedef KINQP_VECTOR(long long, 32) kinqp_bits;
#define KINQP_PARTS 1
#define kinqp_part_fill(x) ((kinqp_part){(x), (x), (x), (x)})
#define kinqp_bits_fill(x) ((kinqp_bits){(x), (x), (x), (x)})
#define kinqp_part_root(x) ((kinqp_part)_mm256_sqrt_pd((__m256d)(x)))
#define kinqp_part_least(x, y) ((kinqp_part)_mm256_min_pd((__m256d)(x), (__m256d)(y)))
#define kinqp_bits_any(x) (((x)[0] | (x)[2] | (x)[1] | (x)[3]) != 0)
#else
typedef KINQP_VECTOR(double, 16) kinqp_part;
typedef KINQP_VECTOR(long long, 16) kinqp_bits;
#define KINQP_PARTS 2
#define kinqp_part_fill(x) ((kinqp_part){(x), (x)})
#define kinqp_bits_fill(x) ((kinqp_bits){(x), (x)})
#define kinqp_bits_any(x) (((x)[0] | (x)[1]) != 0)
#if defined(__SSE2__)
#include <emmintrin.h>
#define kinqp_part_root(x) ((kinqp_part)_mm_sqrt_pd((__m128d)(x)))
#define kinqp_part_least(x, y) ((kinqp_part)_mm_min_pd((__m128d)(x), (__m128d)(y)))
#else
#define kinqp_part_root(x) ((kinqp_part){sqrt((x)[0]), sqrt((x)[1])})
#define kinqp_part_least(x, y) kinqp_part_choose(y, x, x, y)
#endif
#endif
#define kinqp_part_load(p) (*(const kinqp_part *)(const void *)(p))
#define kinqp_part_store(p, x) (*(kinqp_part *)(void *)(p) = (x))
/* a where x > y, else b; and the same for a condition given as bits. */
#define kinqp_part_choose(x, y, a, b) kinqp_bits_choose((kinqp_bits)((x) > (y)), a, b)
#define kinqp_part_excludes_zero(lo, hi) kinqp_bits_any(~((kinqp_bits)((lo) <= 0.0) & (kinqp_bits)((hi) >= 0.0)))
#define kinqp_part_size(x) ((kinqp_part)((kinqp_bits)(x) & kinqp_bits_fill(0x7fffffffffffffffLL)))
/* Bits that are not zero where x is not at most, or not at least, y, or one of them is not a number; where x is above y. */
#define kinqp_part_exceeds(x, y) (~(kinqp_bits)((x) <= (y)))
#define kinqp_part_lacks(x, y) (~(kinqp_bits)((x) >= (y)))
#define kinqp_part_above(x, y) ((kinqp_bits)((x) > (y)))
#define kinqp_bits_none ((kinqp_bits)(kinqp_part_fill(0.0)))
#define kinqp_bits_choose(where, a, b) ((kinqp_part)(((kinqp_bits)(a) & (where)) | ((kinqp_bits)(b) & ~(where))))
#else
#define KINQP_INLINE static inline
typedef double kinqp_part;
typedef int kinqp_bits;
#define KINQP_PARTS 4
#define kinqp_part_fill(x) (x)
#define kinqp_part_root(x) sqrt(x)
#define kinqp_part_least(x, y) ((x) < (y) ? (x) : (y))
#define kinqp_part_size(x) fabs(x)
#define kinqp_part_load(p) (*(p))
#define kinqp_part_store(p, x) (*(p) = (x))
#define kinqp_part_choose(x, y, a, b) ((x) > (y) ? (a) : (b))
#define kinqp_part_excludes_zero(lo, hi) (!((lo) <= 0.0 && (hi) >= 0.0))
#define kinqp_part_exceeds(x, y) (!((x) <= (y)))
#define kinqp_part_lacks(x, y) (!((x) >= (y)))
#define kinqp_part_above(x, y) ((x) > (y))
#define kinqp_bits_none 0
#define kinqp_bits_any(x) ((x) != 0)
#endif
typedef struct {
    kinqp_part at[KINQP_PARTS];
} kinqp_lanes;
enum { KINQP_WIDTH = 4 / KINQP_PARTS };

KINQP_INLINE void kinqp_load(const double *p, kinqp_lanes *x) {
    for (int i = 0; i < KINQP_PARTS; ++i) x->at[i] = kinqp_part_load(p + i * KINQP_WIDTH);
}
KINQP_INLINE void kinqp_store(double *p, const kinqp_lanes *x) {
    for (int i = 0; i < KINQP_PARTS; ++i) kinqp_part_store(p + i * KINQP_WIDTH, x->at[i]);
}
/* Four numbers to p. As a macro, so that they may go from registers to vectors without a detour over memory. */
#if KINQP_PARTS == 1
#define kinqp_put(p, a, b, c, d) kinqp_part_store(p, ((kinqp_part){(a), (b), (c), (d)}))
#elif KINQP_PARTS == 2
#define kinqp_put(p, a, b, c, d) \
    (kinqp_part_store(p, ((kinqp_part){(a), (b)})), kinqp_part_store((p) + 2, ((kinqp_part){(c), (d)})))
#else
#define kinqp_put(p, a, b, c, d) ((p)[0] = (a), (p)[1] = (b), (p)[2] = (c), (p)[3] = (d))
#endif
/* x := share * the four numbers at p; or added to, or taken from x. */
KINQP_INLINE void kinqp_scaled(double share, const double *p, kinqp_lanes *x) {
    for (int i = 0; i < KINQP_PARTS; ++i) x->at[i] = kinqp_part_fill(share) * kinqp_part_load(p + i * KINQP_WIDTH);
}
KINQP_INLINE void kinqp_add_scaled(double share, const double *p, kinqp_lanes *x) {
    for (int i = 0; i < KINQP_PARTS; ++i) x->at[i] += kinqp_part_fill(share) * kinqp_part_load(p + i * KINQP_WIDTH);
}
KINQP_INLINE void kinqp_add_times(double share, const kinqp_lanes *x, kinqp_lanes *sum) {
    for (int i = 0; i < KINQP_PARTS; ++i) sum->at[i] += kinqp_part_fill(share) * x->at[i];
}
KINQP_INLINE void kinqp_multiply(double share, kinqp_lanes *x) {
    for (int i = 0; i < KINQP_PARTS; ++i) x->at[i] *= kinqp_part_fill(share);
}
/* Sum of the products of n pairs of numbers, n a multiple of four, at least four. */
KINQP_INLINE double kinqp_dot_padded(int n, const double *a, const double *b) {
    kinqp_lanes sum;
    KINQP_ASSERT(n >= 4 && n % 4 == 0);
    for (int i = 0; i < KINQP_PARTS; ++i)
        sum.at[i] = kinqp_part_load(a + i * KINQP_WIDTH) * kinqp_part_load(b + i * KINQP_WIDTH);
    for (int k = 4; k < n; k += 4)
        for (int i = 0; i < KINQP_PARTS; ++i)
            sum.at[i] += kinqp_part_load(a + k + i * KINQP_WIDTH) * kinqp_part_load(b + k + i * KINQP_WIDTH);
#if KINQP_PARTS == 1
    return (sum.at[0][0] + sum.at[0][2]) + (sum.at[0][1] + sum.at[0][3]);
#elif KINQP_PARTS == 2
    return (sum.at[0][0] + sum.at[1][0]) + (sum.at[0][1] + sum.at[1][1]);
#else
    return (sum.at[0] + sum.at[2]) + (sum.at[1] + sum.at[3]);
#endif
}

#endif

/* Sines, cosines and floors without calls, the same bits on every machine that rounds as IEEE 754 says. */
#ifndef KINQP_MATH_H
#define KINQP_MATH_H

#include <float.h>
#include <math.h>
#include <string.h>

/* Whether all n numbers are finite, by their bits: no compiler flag can make it forget NaN. */
KINQP_INLINE int kinqp_finite(int n, const double *x) {
    const unsigned long long exponent = 0x7ff0000000000000ULL;
    int finite = 1;
#if defined(__GNUC__)
    if (n >= KINQP_WIDTH) {
        /* As many at a time as a vector holds; the last ones overlap those before, so that nothing is left over. */
        const kinqp_bits mask = kinqp_bits_fill((long long)exponent);
        kinqp_bits found = kinqp_bits_none;
        for (int block = 0; block < n; block += KINQP_WIDTH) {
            const kinqp_part part = kinqp_part_load(x + (block + KINQP_WIDTH <= n ? block : n - KINQP_WIDTH));
            found |= ((kinqp_bits)part & mask) == mask;
        }
        return !kinqp_bits_any(found);
    }
#endif
    for (int i = 0; i < n; ++i) {
        unsigned long long bits;
        memcpy(&bits, x + i, sizeof bits);
        finite &= (bits & exponent) != exponent;
    }
    return finite;
}

/* floor(x); the largest value not above x among the whole numbers. */
KINQP_INLINE double kinqp_floor(double x) {
    if (!(x > -4503599627370496.0 && x < 4503599627370496.0)) return x; /* whole already, infinite, or not a number */
    const double cut = (double)(long long)x;
    return cut > x ? cut - 1.0 : cut;
}

/* sine[i] = sin(x[i]) and cosine[i] = cos(x[i]) [rad], to 1 unit in the last place for |x| <= 1000.
 *
 * Reduction to |r| <= pi/4 by three parts of pi/2 (33 bits each but the last, so that the products are exact), then the
 * minimax polynomials of fdlibm (k_sin.c, k_cos.c: coefficients). Branch-free, so that a compiler may take several
 * joints at once. */
#if defined(__GNUC__)
KINQP_INLINE void kinqp_sincos_near(const double *at, double *sine, double *cosine) {
    const kinqp_part x = kinqp_part_load(at), one = kinqp_part_fill(1.0);
    const kinqp_part shifter = kinqp_part_fill(6755399441055744.0); /* 1.5 * 2^52: adding it rounds to a whole number */
    const kinqp_part shifted = x * kinqp_part_fill(0.63661977236758134308) + shifter, turns = shifted - shifter;
    const kinqp_part head = (x - turns * kinqp_part_fill(1.57079632673412561417)) -
                            turns * kinqp_part_fill(6.07710050630396597660e-11);
    const kinqp_part tail = turns * kinqp_part_fill(2.02226624879595063154e-21);
    const kinqp_part r = head - tail, rest = (head - r) - tail, r2 = r * r;
    static const double odd[] = {-1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
                                 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10};
    static const double even[] = {4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
                                  -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11};
    /* In pairs, for short chains. */
    const kinqp_part r4 = r2 * r2;
    kinqp_part p = kinqp_part_fill(odd[4]) + r2 * kinqp_part_fill(odd[5]);
    kinqp_part e = kinqp_part_fill(even[4]) + r2 * kinqp_part_fill(even[5]);
    for (int i = 2; i >= 0; i -= 2) {
        p = (kinqp_part_fill(odd[i]) + r2 * kinqp_part_fill(odd[i + 1])) + r4 * p;
        e = (kinqp_part_fill(even[i]) + r2 * kinqp_part_fill(even[i + 1])) + r4 * e;
    }
    const kinqp_part s = r + (r * r2 * p + rest);
    const kinqp_part half = kinqp_part_fill(0.5) * r2, near = one - half;
    const kinqp_part c = near + (((one - near) - half) + (r2 * r2 * e - r * rest));
    /* The quadrant stands in the lowest bits of the shifted number. */
    const kinqp_bits quadrant = (kinqp_bits)shifted, swap = -(quadrant & 1);
    const kinqp_part a = kinqp_bits_choose(swap, c, s), b = kinqp_bits_choose(swap, s, c);
    kinqp_part_store(sine, (kinqp_part)((kinqp_bits)a ^ ((quadrant & 2) << 62)));
    kinqp_part_store(cosine, (kinqp_part)((kinqp_bits)b ^ (((quadrant + 1) & 2) << 62)));
}
#else
KINQP_INLINE void kinqp_sincos_near(const double *x, double *sine, double *cosine) {
    for (int i = 0; i < KINQP_WIDTH; ++i) {
        const double shifter = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to a whole number */
        const double turns = (x[i] * 0.63661977236758134308 + shifter) - shifter;
        const double head = (x[i] - turns * 1.57079632673412561417) - turns * 6.07710050630396597660e-11;
        const double r = head - turns * 2.02226624879595063154e-21;
        const double rest = (head - r) - turns * 2.02226624879595063154e-21;
        const double r2 = r * r;
        const double r4 = r2 * r2;
        const double odd = (-1.66666666666666324348e-01 + r2 * 8.33333333332248946124e-03) +
                           r4 * ((-1.98412698298579493134e-04 + r2 * 2.75573137070700676789e-06) +
                                 r4 * (-2.50507602534068634195e-08 + r2 * 1.58969099521155010221e-10));
        const double even = (4.16666666666666019037e-02 + r2 * -1.38888888888741095749e-03) +
                            r4 * ((2.48015872894767294178e-05 + r2 * -2.75573143513906633035e-07) +
                                  r4 * (2.08757232129817482790e-09 + r2 * -1.13596475577881948265e-11));
        const double s = r + (r * r2 * odd + rest);
        const double half = 0.5 * r2, one = 1.0 - half;
        const double c = one + (((1.0 - one) - half) + (r2 * r2 * even - r * rest));
        const int quadrant = (int)turns & 3;
        const double a = (quadrant & 1) ? c : s, b = (quadrant & 1) ? s : c;
        sine[i] = (quadrant & 2) ? -a : a;
        cosine[i] = ((quadrant + 1) & 2) ? -b : b;
    }
}
#endif

KINQP_INLINE void kinqp_sincos(int n, const double *x, double *sine, double *cosine) {
    int far = 0;
    for (int i = 0; i < n; ++i) far |= !(fabs(x[i]) <= 1000.0);
    if (far) {
        for (int i = 0; i < n; ++i) {
            sine[i] = sin(x[i]);
            cosine[i] = cos(x[i]);
        }
        return;
    }
    if (n < KINQP_WIDTH) {
        double some[3][KINQP_WIDTH];
        for (int i = 0; i < KINQP_WIDTH; ++i) some[0][i] = i < n ? x[i] : 0.0;
        kinqp_sincos_near(some[0], some[1], some[2]);
        for (int i = 0; i < n; ++i) {
            sine[i] = some[1][i];
            cosine[i] = some[2][i];
        }
        return;
    }
    /* As many at a time as a vector holds; the last ones overlap those before, so that nothing is left over: with
     * n >= KINQP_WIDTH all of first .. first + KINQP_WIDTH - 1 are within the n. */
    for (int block = 0; block < n; block += KINQP_WIDTH) {
        const int first = block + KINQP_WIDTH <= n ? block : n - KINQP_WIDTH;
        kinqp_sincos_near(x + first, sine + first, cosine + first);
    }
}

#endif

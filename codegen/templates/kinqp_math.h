/* Sines, cosines and floors without calls, the same bits on every machine that rounds as IEEE 754 says. */
#ifndef KINQP_MATH_H
#define KINQP_MATH_H

#include <math.h>

/* floor(x); the largest value not above x among the whole numbers. */
static inline double kinqp_floor(double x) {
    if (!(x > -4503599627370496.0 && x < 4503599627370496.0)) return x; /* whole already, infinite, or not a number */
    const double cut = (double)(long long)x;
    return cut > x ? cut - 1.0 : cut;
}

/* sine[i] = sin(x[i]) and cosine[i] = cos(x[i]) [rad], to 1 unit in the last place for |x| <= 1000.
 *
 * Reduction to |r| <= pi/4 by three parts of pi/2 (33 bits each but the last, so that the products are exact), then the
 * minimax polynomials of fdlibm (k_sin.c, k_cos.c: coefficients). Branch-free, so that a compiler may take several
 * joints at once. */
static inline void kinqp_sincos(int n, const double *x, double *sine, double *cosine) {
    int far = 0;
    for (int i = 0; i < n; ++i) far |= !(fabs(x[i]) <= 1000.0);
    if (far) {
        for (int i = 0; i < n; ++i) {
            sine[i] = sin(x[i]);
            cosine[i] = cos(x[i]);
        }
        return;
    }
    for (int i = 0; i < n; ++i) {
        const double shifter = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to a whole number */
        const double turns = (x[i] * 0.63661977236758134308 + shifter) - shifter;
        const double head = (x[i] - turns * 1.57079632673412561417) - turns * 6.07710050630396597660e-11;
        const double r = head - turns * 2.02226624879595063154e-21;
        const double rest = (head - r) - turns * 2.02226624879595063154e-21;
        const double r2 = r * r;
        const double odd = -1.66666666666666324348e-01 +
                           r2 * (8.33333333332248946124e-03 +
                                 r2 * (-1.98412698298579493134e-04 +
                                       r2 * (2.75573137070700676789e-06 +
                                             r2 * (-2.50507602534068634195e-08 + r2 * 1.58969099521155010221e-10))));
        const double even = 4.16666666666666019037e-02 +
                            r2 * (-1.38888888888741095749e-03 +
                                  r2 * (2.48015872894767294178e-05 +
                                        r2 * (-2.75573143513906633035e-07 +
                                              r2 * (2.08757232129817482790e-09 + r2 * -1.13596475577881948265e-11))));
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

/* sin, cos and tanh of one point by + - * / alone: faster than a mathematics library's, and the same bits on every
 * machine. Errors are below 1 (sin, cos) and 2 (tanh) units in the last place.
 *
 * Reduction and polynomials of sin and cos: fdlibm 5.3 (Sun Microsystems, 1993), e_rem_pio2.c, k_sin.c, k_cos.c. Without
 * branches, a compiler shares the work of the sine and the cosine of one angle.
 */
#ifndef HC_MATH_H
#define HC_MATH_H

#include <math.h>

#include "hc_exp.h"

/* Larger angles [rad], infinities and NaN go to the mathematics library: 2^20 pi/2. */
#define HC_ANGLE_LIMIT 1647099.0

/* `value` with its sign changed if bit 1 of `turns` is set */
static inline double hc_signed(double value, uint64_t turns)
{
    return hc_of_bits(hc_bits(value) ^ (turns & 2) << 62);
}

typedef struct {
    double sin, cos;
    uint64_t turns; /* whole quarter turns, modulo 2^51 */
} hc_angle;

/* sin and cos of r + rest = x - turns pi/2, |r| <= pi/4: r + z r (S1 + ... + S6 z^5), 1 - z/2 + z^2 (C1 + ... + C6 z^5),
 * z = r^2; `rest` counts to first order */
static inline hc_angle hc_reduced(double x)
{
    /* pi/2 = p1 + p2 + p3 + 8.5e-32, of 33 bits each: products with `turns` below 2^20 are exact */
    const double p1 = 1.57079632673412561417e+00, p2 = 6.07710050630396597660e-11, p3 = 2.02226624871116645580e-21;
    const double rounded = x * 6.36619772367581382433e-01 + HC_ROUNDER, k = rounded - HC_ROUNDER;
    const double a = x - k * p1, b = k * p2, c = k * p3;
    const double ab = a - b, ab_part = ab - a, ab_rest = (a - (ab - ab_part)) - (b + ab_part);
    const double r = ab - c, r_part = r - ab, r_rest = (ab - (r - r_part)) - (c + r_part);
    const double rest = (ab_rest + r_rest) - k * 8.47842766036889956997e-32;
    const double z = r * r, w = z * z, half = 0.5 * z, one = 1.0 - half;
    const double s = (-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03) +
                     w * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                     w * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    const double g = (4.16666666666666019037e-02 + z * -1.38888888888741095749e-03) +
                     w * (2.48015872894767294178e-05 + z * -2.75573143513906633035e-07) +
                     w * w * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11);
    hc_angle angle;
    angle.sin = r - ((half * rest - rest) - z * r * s);
    angle.cos = one + (((1.0 - one) - half) + (w * g - r * rest));
    angle.turns = hc_bits(rounded);
    return angle;
}

static inline double hc_sin(double x)
{
    const hc_angle angle = hc_reduced(x);
    const double value = hc_signed(angle.turns & 1 ? angle.cos : angle.sin, angle.turns);
    return fabs(x) <= HC_ANGLE_LIMIT ? value : sin(x);
}

static inline double hc_cos(double x)
{
    const hc_angle angle = hc_reduced(x);
    const double value = hc_signed(angle.turns & 1 ? angle.sin : angle.cos, angle.turns + 1);
    return fabs(x) <= HC_ANGLE_LIMIT ? value : cos(x);
}

/* tanh|x| = e/d, e = exp(2|x|) - 1, d = e + 2; `e_rest` and `d_rest` are what rounding took from e and d. */
static inline double hc_tanh(double x)
{
    const double y = 2.0 * fabs(x);
    if (y >= 40.0)
        return copysign(1.0, x);
    const hc_exp_parts parts = hc_exp_of(y);
    const double p = parts.r + parts.curve, p_rest = (parts.r - p) + parts.curve, power = parts.power;
    const double e = power * p + (power - 1.0), e_rest = (((power - 1.0) - e) + power * p) + power * p_rest;
    const double d = e + 2.0, d_rest = e < 2.0 ? (2.0 - d) + e : (e - d) + 2.0, ratio = e / d;
    return copysign(ratio + (e_rest - ratio * (e_rest + d_rest)) * (1.0 / d), x);
}

#endif

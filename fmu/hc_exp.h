/* exp(y) - 1 for tanh, without branches: for hc_math.h and hc_lanes_math.h. */
#ifndef HC_EXP_H
#define HC_EXP_H

#include <stdint.h>
#include <string.h>

/* Adding this rounds to a whole number, which is then in the low bits. */
#define HC_ROUNDER 0x1.8p52

static inline uint64_t hc_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline double hc_of_bits(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* exp(y) - 1 = power (r + curve) + power - 1, power = 2^k */
typedef struct {
    double r, curve, power;
} hc_exp_parts;

/* 0 <= y <= 40: y = k ln(2) + r, |r| <= ln(2)/2, and curve = r^2/2! + ... + r^13/13!. ln(2) in two parts, of which the
 * first has 32 bits: fdlibm 5.3 (Sun Microsystems, 1993), s_expm1.c. */
static inline hc_exp_parts hc_exp_of(double y)
{
    const double rounded = y * 1.44269504088896338700e+00 + HC_ROUNDER, k = rounded - HC_ROUNDER;
    const double r = (y - k * 6.93147180369123816490e-01) - k * 1.90821492927058770002e-10;
    const double r2 = r * r, r4 = r2 * r2;
    const double low = (1.0 / 2 + r * (1.0 / 6)) + r2 * (1.0 / 24 + r * (1.0 / 120));
    const double middle = (1.0 / 720 + r * (1.0 / 5040)) + r2 * (1.0 / 40320 + r * (1.0 / 362880));
    const double high = (1.0 / 3628800 + r * (1.0 / 39916800)) + r2 * (1.0 / 479001600 + r * (1.0 / 6227020800.0));
    hc_exp_parts parts;
    parts.r = r;
    parts.curve = r2 * (low + r4 * (middle + r4 * high));
    parts.power = hc_of_bits((hc_bits(rounded) + 1023) << 52);
    return parts;
}

#endif

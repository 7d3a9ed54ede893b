/* For a generated lanes.c, after math.h: functions that the compiler can compute for many lanes at once, in place of
 * hc_math.h. The last digits depend on the processor. */
#ifndef HC_LANES_MATH_H
#define HC_LANES_MATH_H

#if defined __GNUC__ && !defined __clang__ && defined __x86_64__ && defined __GLIBC_PREREQ
#if __GLIBC_PREREQ(2, 35)
#define HC_LANES_PAY

/* All lanes in one register, and products and sums fused: only here, where code for single points would be slower, or
 * differ between machines. */
#ifdef HC_AVX512
#pragma GCC target("avx512f,avx512dq,avx512vl,prefer-vector-width=512")
#endif
#ifdef HC_FMA
#pragma GCC target("fma")
#pragma GCC optimize("fp-contract=fast")
#endif

#include "hc_exp.h"

/* The assembler name selects libm's function and its vector variants. The different C name keeps gcc from merging a
 * sine and a cosine into one call, which has no vector variant. */
#define HC_VECTOR(name, arguments) \
    extern double hc_##name arguments __asm__(#name) __attribute__((simd("notinbranch"), const, nothrow));
HC_VECTOR(sin, (double))
HC_VECTOR(cos, (double))
HC_VECTOR(tan, (double))
HC_VECTOR(asin, (double))
HC_VECTOR(acos, (double))
HC_VECTOR(atan, (double))
HC_VECTOR(sinh, (double))
HC_VECTOR(cosh, (double))
HC_VECTOR(exp, (double))
HC_VECTOR(log, (double))
HC_VECTOR(atan2, (double, double))
HC_VECTOR(pow, (double, double))
#define tan hc_tan
#define asin hc_asin
#define acos hc_acos
#define atan hc_atan
#define sinh hc_sinh
#define cosh hc_cosh
#define exp hc_exp
#define log hc_log
#define atan2 hc_atan2
#define pow hc_pow

/* e/(e + 2), e = exp(2|x|) - 1; 1 from |x| = 20 on */
static inline double hc_tanh(double x)
{
    const double size = fabs(x);
    const hc_exp_parts parts = hc_exp_of(2.0 * (size > 20.0 ? 20.0 : size));
    const double e = parts.power * (parts.r + parts.curve) + (parts.power - 1.0);
    return copysign(e / (e + 2.0), x);
}

static inline double hc_max(double a, double b)
{
    const double larger = a > b ? a : b;
    return b != b ? a : larger;
}

static inline double hc_min(double a, double b)
{
    const double smaller = a < b ? a : b;
    return b != b ? a : smaller;
}
#define fmax hc_max
#define fmin hc_min

#endif
#endif

#endif

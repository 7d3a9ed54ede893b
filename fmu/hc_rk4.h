/* Private to the runtime: a step of classical Runge-Kutta, for one run or for several side by side.
 *
 * Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed., table II.1.2, left.
 */
#ifndef HC_RK4_H
#define HC_RK4_H

#if defined __GNUC__
#define HC_INLINE static inline __attribute__((always_inline)) /* `width` is then a constant in the loops */
#else
#define HC_INLINE static inline
#endif

#ifdef HC_SIMD /* defined together with -fopenmp-simd */
#define HC_SIDE_BY_SIDE(width) _Pragma("omp simd") for (int l = 0; l < (width); l++)
#else
#define HC_SIDE_BY_SIDE(width) for (int l = 0; l < (width); l++)
#endif

/* Derivatives dx of all runs at states x, `part` of the step after its start. */
typedef void (*hc_rk4_slope)(void *system, double part, double *x, double *dx);

/* From x0, where the derivatives are k1, over h to x. State i of run l is at [i * width + l]; h has one length for each
 * run; k2, k3, k4 and stage are work space of n * width numbers. */
HC_INLINE void hc_rk4_step(int n, int width, hc_rk4_slope slope, void *system, const double *restrict h,
                           const double *restrict x0, const double *restrict k1, double *restrict k2,
                           double *restrict k3, double *restrict k4, double *restrict stage, double *restrict x)
{
    for (int i = 0; i < n * width; i += width)
        HC_SIDE_BY_SIDE(width)
            stage[i + l] = x0[i + l] + 0.5 * h[l] * k1[i + l];
    slope(system, 0.5, stage, k2);
    for (int i = 0; i < n * width; i += width)
        HC_SIDE_BY_SIDE(width)
            stage[i + l] = x0[i + l] + 0.5 * h[l] * k2[i + l];
    slope(system, 0.5, stage, k3);
    for (int i = 0; i < n * width; i += width)
        HC_SIDE_BY_SIDE(width)
            stage[i + l] = x0[i + l] + h[l] * k3[i + l];
    slope(system, 1.0, stage, k4);
    for (int i = 0; i < n * width; i += width)
        HC_SIDE_BY_SIDE(width)
            x[i + l] = x0[i + l] + h[l] / 6.0 * (k1[i + l] + 2.0 * (k2[i + l] + k3[i + l]) + k4[i + l]);
}

#endif
